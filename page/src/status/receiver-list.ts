/** Which receivers are supervised, and why others are not; those first. */

import { css, html } from "lit";
import { customElement } from "lit/decorators.js";
import { MARKS, StatusPart } from "./status-part";

@customElement("receiver-list")
export class ReceiverList extends StatusPart {
  static override styles = [
    ...StatusPart.styles,
    css`
      li {
        margin: 0.4rem 0;
        overflow-wrap: anywhere;
      }
      li.wrong {
        border-left: 0.4rem solid var(--alarm);
        padding-left: 0.5rem;
      }
      strong {
        color: var(--ink);
      }
      .wrong b {
        text-transform: uppercase;
      }
      .why {
        display: block;
      }
    `,
  ];

  override render() {
    const { status, isCurrent } = this.view;
    const devices = (status?.devices ?? []).map((one) => ({ ...one, supervised: one.supervised && isCurrent }));
    if (!devices.length) return html`<h2>${this.say("receivers")}</h2><p class="doubt">${this.say("receiversNone")}</p>`;
    const supervised = devices.filter((one) => one.supervised);
    const others = devices.filter((one) => !one.supervised);
    return html`
      <h2>${this.say("receivers")}: <span role="status">${this.say("receiversCount", { n: supervised.length, all: devices.length })}</span></h2>
      <ul class="plain">
        ${others.map(
          (one) => html`<li class="wrong">
            <strong>${one.name}</strong> <b>${MARKS.bad} ${this.say("notSupervised")}</b>
            ${isCurrent ? html`<span class="why" lang="en">${one.reason}</span>` : html`<span class="why">${this.say("noAnswerWhy")}</span>`}
          </li>`,
        )}
        ${supervised.map(
          (one) => html`<li>
            <strong>${one.name}</strong> <span class="good">${MARKS.good} ${this.say("supervised")}</span> ${this.say("supervisedBy", { streams: one.streams.join(", ") })}
          </li>`,
        )}
      </ul>
    `;
  }
}
