/** Ten seconds of the film, run as they will be. */

import { css, html, nothing } from "lit";
import { customElement } from "lit/decorators.js";
import { SetupPart } from "./setup-part";

@customElement("trial-panel")
export class TrialPanel extends SetupPart {
  static override styles = [
    ...SetupPart.styles,
    css`
      video,
      progress {
        width: 100%;
        border-radius: 6px;
      }
    `,
  ];

  override render() {
    const { trial, draft } = this.site;
    if (!draft) return nothing;
    const running = trial.state === "running";
    return html`
      <h2>${this.say("trial")}</h2>
      <button id="trial" ?disabled=${running || !this.site.ground?.found} @click=${() => void this.site.runTrial()}>${this.say("trialRun")}</button>
      ${running ? html`<button @click=${() => void this.site.stopTrial()}>${this.say("trialStop")}</button>` : nothing}
      <div role="status" aria-live="polite">
        ${running
          ? html`<progress max=${trial.frames_expected ?? 1} .value=${trial.frames} aria-label=${this.say("trial")}></progress>
              <p>${this.say("trialFrames", { n: trial.frames, all: trial.frames_expected ?? "?" })}</p>`
          : nothing}
        ${trial.state === "failed" ? html`<p class="wrong">${trial.message}</p>` : nothing} ${trial.state === "done" ? this.outcome() : nothing}
      </div>
    `;
  }

  private outcome() {
    const { summary, number } = this.site.trial;
    if (!summary) return nothing;
    const { frames, frames_with_map, measured_distances, distances, hazards, warnings } = summary;
    return html`
      <p>${this.say("trialMap", { n: frames_with_map, all: frames, pairs: measured_distances, allPairs: distances })}</p>
      <p>${this.say("trialHazards", { warning: hazards["warning"] ?? 0, danger: hazards["danger"] ?? 0 })}</p>
      ${warnings.length ? html`<ul class="doubt">${warnings.map((one) => html`<li>${one}</li>`)}</ul>` : nothing}
      <video controls muted src="/api/trial/${number}/film" aria-label=${this.say("trialFilm")}></video>
    `;
  }
}
