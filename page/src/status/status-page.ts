/** The page of a live site: what is watched and what is not, and who is in danger. */

import { css, html, nothing } from "lit";
import { customElement } from "lit/decorators.js";
import { repeat } from "lit/directives/repeat.js";
import { frameLook, languageChoice } from "../shared/page-frame";
import type { Language } from "../shared/words";
import "./open-hazards";
import "./overall-state";
import "./problem-list";
import "./receiver-list";
import "./service-facts";
import "./shelf-list";
import { StatusPart } from "./status-part";
import "./stream-card";

@customElement("status-page")
export class StatusPage extends StatusPart {
  static override styles = [
    ...StatusPart.styles,
    frameLook,
    css`
      overall-state {
        position: sticky;
        top: 0;
        z-index: 1;
      }
      main {
        grid-template:
          "streams hazards" auto
          "streams rest" 1fr
          / minmax(0, 1fr) 24rem;
        gap: 0.8rem 1rem;
        max-width: none;
      }
      .streams {
        grid-area: streams;
        display: grid;
        grid-template-columns: repeat(auto-fit, minmax(min(21rem, 100%), 1fr));
        gap: 0.8rem;
        align-content: start;
      }
      .hazards {
        grid-area: hazards;
        margin: 0;
      }
      .rest {
        grid-area: rest;
      }
      @media (max-width: 60rem) {
        main {
          grid-template: "hazards" auto "streams" auto "rest" auto / minmax(0, 1fr);
          padding: 0.8rem 0.6rem;
        }
      }
    `,
  ];

  override connectedCallback(): void {
    super.connectedCallback();
    document.documentElement.lang = this.language;
    this.view.open();
  }

  override updated(): void {
    const { status } = this.view;
    document.title = `${this.mark} ${status?.site ?? "standoff"}`.trim();
  }

  /** What a tab in the background shows. */
  private get mark(): string {
    const { status, unwatched, isSilent } = this.view;
    if (isSilent) return "✗";
    if (!status) return "";
    if (unwatched) return `✗ ${unwatched}/${status.streams.length}`;
    return status.overall === "ok" ? "✓" : "✗";
  }

  override render() {
    const { language } = this;
    const { status } = this.view;
    return html`
      <header>
        <h1>${this.say("siteTitle")}${status ? html` · ${status.site}` : nothing}</h1>
        ${languageChoice(language, (chosen: Language) => (this.language = chosen))}
      </header>
      <overall-state .language=${language}></overall-state>
      <problem-list .language=${language}></problem-list>
      ${status
        ? html`<main>
            <section class="hazards"><open-hazards .language=${language}></open-hazards></section>
            <div class="streams">
              <h2 class="unseen">${this.say("streams")}</h2>
              ${repeat(
                status.streams,
                (one) => one.name,
                (one) => html`<stream-card .language=${language} .stream=${one}></stream-card>`,
              )}
            </div>
            <div class="rest">
              <section><receiver-list .language=${language}></receiver-list></section>
              <section><shelf-list .language=${language}></shelf-list></section>
              <section><service-facts .language=${language}></service-facts></section>
            </div>
          </main>`
        : nothing}
    `;
  }
}
