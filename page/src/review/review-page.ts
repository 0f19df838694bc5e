/** The page of a finished run: film, plan and curves, and beside them the hazards. */

import { html, nothing } from "lit";
import { customElement } from "lit/decorators.js";
import { frameLook, languageChoice } from "../shared/page-frame";
import type { Language, Word } from "../shared/words";
import "./film-view";
import "./hazard-list";
import { ReviewPart } from "./review-part";
import "./run-curves";
import "./run-plan";

@customElement("review-page")
export class ReviewPage extends ReviewPart {
  static override styles = [...ReviewPart.styles, frameLook];

  override connectedCallback(): void {
    super.connectedCallback();
    document.documentElement.lang = this.language;
    void this.view.open();
  }

  override render() {
    const { view, language } = this;
    const { run } = view;
    return html`
      <header>
        <h1>${this.say("runTitle")}${run ? html` · ${run.name}` : nothing}</h1>
        ${languageChoice(language, (chosen: Language) => (this.language = chosen))}
      </header>
      <div role="alert">
        ${view.isOffline ? html`<p class="notice wrong">${this.say("offline")}</p>` : nothing}
        ${view.problem ? html`<p class="notice wrong">${view.problem}</p>` : nothing}
      </div>
      <main>
        <div>
          <section><film-view .language=${language}></film-view></section>
          <div class="below">
            <section><run-curves .language=${language}></run-curves></section>
            <section><run-plan .language=${language}></run-plan></section>
          </div>
        </div>
        <div>
          <section>${this.about()}</section>
          <section><hazard-list .language=${language}></hazard-list></section>
        </div>
      </main>
    `;
  }

  private about() {
    const { run } = this.view;
    if (!run) return html`<p class="quiet">${this.say("looking")}</p>`;
    const percent = (share: number | null) => (share === null ? this.say("unknown") : `${Math.floor(100 * share)} %`);
    return html`
      ${run.status && run.status !== "complete" ? html`<p class="wrong">⚠ ${this.say(`status_${run.status}` as Word)}: ${run.message}</p>` : nothing}
      <p>${this.say("runWatched", { share: percent(run.watched_share), mapped: percent(run.mapped_share) })}</p>
      ${run.missing.length ? html`<p class="doubt">${this.say("tablesMissing", { names: run.missing.join(", ") })}</p>` : nothing}
      ${run.warnings.length ? html`<ul class="doubt">${run.warnings.map((one) => html`<li>${one}</li>`)}</ul>` : nothing}
      <p class="quiet">${run.assistance}</p>
    `;
  }
}
