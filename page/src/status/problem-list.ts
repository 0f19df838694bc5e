/** What is wrong, and what limits the watch, each in a line. */

import { css, html, nothing } from "lit";
import { customElement } from "lit/decorators.js";
import { StatusPart } from "./status-part";

@customElement("problem-list")
export class ProblemList extends StatusPart {
  static override styles = [
    ...StatusPart.styles,
    css`
      :host {
        display: flex;
        flex-wrap: wrap;
        background: var(--panel);
        border-bottom: 1px solid var(--line);
      }
      ul {
        margin: 0;
        padding: 0.4rem 1rem 0.4rem 2.2rem;
        font-size: 1.1rem;
        font-weight: 600;
        overflow-wrap: anywhere;
      }
    `,
  ];

  override render() {
    const { status, isSilent, isShutOut } = this.view;
    const shutOut = isShutOut ? html`<ul class="wrong" aria-label=${this.say("problems")}><li>${this.say("openAgain")}</li></ul>` : nothing;
    if (isSilent || !status) return html`<div role="alert">${shutOut}</div>`;
    const limits = status.streams.flatMap((one) => (this.view.isWatched(one) ? this.limits(one).map((limit) => `${one.name}: ${limit}`) : []));
    const unsupervised = status.devices.filter((one) => !one.supervised).length;
    if (unsupervised) limits.push(this.say("limitReceivers", { n: unsupervised, all: status.devices.length }));
    const { problems } = status;
    return html`
      <div role="alert">
        ${problems.length ? html`<ul class="wrong" lang="en" aria-label=${this.say("problems")}>${problems.map((one) => html`<li>${one}</li>`)}</ul>` : nothing}
      </div>
      <div role="status">
        ${limits.length ? html`<ul class="doubt" aria-label=${this.say("doubts")}>${limits.map((one) => html`<li>${one}</li>`)}</ul>` : nothing}
      </div>
    `;
  }
}
