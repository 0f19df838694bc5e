/** The page: picture and plan, and beside them step by step what is to be told. */

import { css, html, nothing } from "lit";
import { customElement } from "lit/decorators.js";
import "./basis-panel";
import { SetupPart } from "./setup-part";
import "./picture-view";
import "./plan-view";
import type { UnitName } from "./questions";
import "./radii-panel";
import "./result-panel";
import "./save-panel";
import "./trial-panel";
import { frameLook, languageChoice } from "../shared/page-frame";
import type { Language } from "../shared/words";
import "./zones-panel";

@customElement("setup-page")
export class SetupPage extends SetupPart {
  static override styles = [
    ...SetupPart.styles,
    frameLook,
    css`
      .time {
        display: flex;
        gap: 0.8rem;
        align-items: center;
      }
      .time input {
        flex: 1;
        accent-color: var(--accent);
      }
    `,
  ];

  override connectedCallback(): void {
    super.connectedCallback();
    document.documentElement.lang = this.language;
    void this.site.open();
  }

  override render() {
    const { site, language } = this;
    return html`
      <header>
        <h1>${this.say("title")}${site.film ? html` · ${site.film.name}` : nothing}</h1>
        <label>
          ${this.say("unit")}
          <select name="unit" @change=${(event: Event) => site.change((one) => (one.unit = (event.target as HTMLSelectElement).value as UnitName))}>
            ${(["metres", "feet"] as const).map((unit) => html`<option value=${unit} ?selected=${site.draft?.unit === unit}>${this.say(unit)}</option>`)}
          </select>
        </label>
        ${languageChoice(language, (chosen: Language) => (this.language = chosen))}
      </header>
      <div role="alert">
        ${site.isOffline ? html`<p class="notice wrong">${this.say("offline")}</p>` : nothing}
        ${site.problem ? html`<p class="notice wrong">${site.problem}</p>` : nothing}
        ${site.isStale ? html`<p class="notice wrong">${this.say("stale")} <button @click=${() => void site.loadDraft()}>${this.say("reload")}</button></p>` : nothing}
      </div>
      <main>
        <div>
          <section>
            <picture-view .language=${language}></picture-view>
            ${this.time()}
          </section>
          <div class="below">
            <section><plan-view .language=${language}></plan-view></section>
            <section><trial-panel .language=${language}></trial-panel></section>
          </div>
        </div>
        <div>
          <section><basis-panel .language=${language}></basis-panel></section>
          <section><result-panel .language=${language}></result-panel></section>
          <section><zones-panel .language=${language}></zones-panel></section>
          <section><radii-panel .language=${language}></radii-panel></section>
          <section><save-panel .language=${language}></save-panel></section>
        </div>
      </main>
    `;
  }

  private time() {
    const { film, timeS } = this.site;
    if (!film) return nothing;
    const step = film.fps ? 1 / film.fps : 0.04;
    return html`
      <label class="time">
        ${this.say("time")}
        <input
          type="range"
          name="time"
          min=${film.first_s}
          max=${film.last_s}
          step=${step}
          .value=${String(timeS)}
          @change=${(event: Event) => void this.site.goTo(Number((event.target as HTMLInputElement).value))}
        />
        <output>${timeS.toFixed(2)} ${this.say("seconds")}</output>
      </label>
    `;
  }
}
