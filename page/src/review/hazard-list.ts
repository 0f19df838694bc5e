/** The hazards of the run: filtered, jumped to, judged. */

import { css, html, nothing } from "lit";
import { customElement, state } from "lit/decorators.js";
import { TONES } from "../shared/look";
import type { Word } from "../shared/words";
import type { HazardAnswer, Severity, Verdict } from "./questions";
import { clock, ReviewPart } from "./review-part";

const SEVERITIES: Severity[] = ["danger", "warning", "unknown"];
const VERDICTS: Verdict[] = ["open", "right", "false_alarm", "unsure"];
/** More are too long a list to be drawn at once, and to be read. */
const ROWS = 200;
const MARKS: Record<Verdict, string> = { open: "", right: "✓", false_alarm: "✗", unsure: "?" };

@customElement("hazard-list")
export class HazardList extends ReviewPart {
  static override styles = [
    ...ReviewPart.styles,
    css`
      .filters {
        display: flex;
        flex-wrap: wrap;
        gap: 0 1rem;
        align-items: center;
      }
      ol {
        list-style: none;
        margin: 0.4rem 0;
        padding: 0;
        max-height: 26rem;
        overflow-y: auto;
      }
      li button {
        display: grid;
        grid-template-columns: 4rem 6.2rem minmax(0, 1fr) 1rem;
        gap: 0.5rem;
        width: 100%;
        text-align: left;
        border-color: transparent;
      }
      li button[aria-current="true"] {
        border-color: var(--accent);
      }
      .time {
        font-variant-numeric: tabular-nums;
      }
      .pill {
        border-radius: 99px;
        padding: 0 0.5rem;
        color: #14181d;
        text-align: center;
        align-self: start;
      }
      fieldset {
        border: 1px solid var(--line);
        border-radius: 8px;
        padding: 0.5rem 0.8rem;
      }
      textarea {
        width: 100%;
      }
    `,
  ];

  @state() private rows = ROWS;

  override render() {
    const { view } = this;
    const { run, shown, chosen } = view;
    if (!run) return nothing;
    if (!run.hazards.length) return html`<h2>${this.say("hazards")}</h2><p class="quiet">${this.say("hazardsNone")}</p>`;
    return html`
      <h2>${this.say("hazards")}</h2>
      <div class="filters" role="group" aria-label=${this.say("layers")}>
        ${SEVERITIES.map((one) => html`<label><input type="checkbox" name=${one} .checked=${view.severities.has(one)} @change=${() => this.toggle(one)} />${this.say(one)}</label>`)}
        <label><input type="checkbox" name="unjudged" .checked=${view.isUnjudgedOnly} @change=${() => this.changed(() => (view.isUnjudgedOnly = !view.isUnjudgedOnly))} />${this.say("unjudged")}</label>
        <label>
          ${this.say("filterKind")}
          <select name="kind" @change=${(event: Event) => this.changed(() => (view.kind = (event.target as HTMLSelectElement).value))}>
            <option value="">${this.say("everyKind")}</option>
            ${view.kinds.map((one) => html`<option value=${one} ?selected=${one === view.kind}>${this.say(one as Word)}</option>`)}
          </select>
        </label>
      </div>
      <p class="quiet" aria-live="polite">${this.say("hazardsShown", { n: shown.length, all: run.hazards.length })}</p>
      <ol>
        ${shown.slice(0, this.rows).map((one) => this.row(one))}
      </ol>
      ${shown.length > this.rows ? html`<button @click=${() => (this.rows += ROWS)}>${this.say("moreHazards", { n: Math.min(ROWS, shown.length - this.rows) })}</button>` : nothing}
      ${chosen ? this.judging(chosen) : nothing}
    `;
  }

  private changed(change: () => void): void {
    change();
    this.view.tellAll();
  }

  private toggle(severity: Severity): void {
    const { severities } = this.view;
    this.changed(() => (severities.has(severity) ? severities.delete(severity) : severities.add(severity)));
  }

  private row(hazard: HazardAnswer) {
    const isCurrent = hazard.hazard_id === this.view.selected;
    return html`<li>
      <button aria-current=${isCurrent ? "true" : "false"} data-hazard=${hazard.hazard_id} @click=${() => this.view.choose(hazard)}>
        <span class="time">${clock(hazard.worst_s)}</span>
        <span class="pill" .style=${`background:${TONES[hazard.severity]}`}>${this.say(hazard.severity)}</span>
        <span>${this.who(hazard)}</span>
        <span title=${hazard.verdict === "open" ? "" : this.say(hazard.verdict)}>${MARKS[hazard.verdict]}</span>
      </button>
    </li>`;
  }

  private judging(hazard: HazardAnswer) {
    const { severity, distance_text, gap_text, opened_s, closed_s, reason } = hazard;
    return html`
      <fieldset>
        <legend><strong>${this.who(hazard)}</strong></legend>
        <p>${this.say(severity)}, ${clock(opened_s)} – ${closed_s === null ? this.say("stillOpen") : clock(closed_s)}${reason ? ` (${reason})` : ""}</p>
        ${hazard.parties.length ? html`<p>${this.say("nearest", { distance: distance_text, gap: gap_text })}</p>` : nothing}
        <div role="radiogroup" aria-label=${this.say("judge")}>
          ${VERDICTS.map(
            (one) => html`<label>
              <input type="radio" name="verdict" value=${one} .checked=${hazard.verdict === one} @change=${() => void this.view.judge(hazard, one, hazard.comment)} />
              ${one === "open" ? this.say("unjudged") : this.say(one)}
            </label>`,
          )}
        </div>
        <label>
          ${this.say("comment")}
          <textarea name="comment" rows="2" maxlength="2000" .value=${hazard.comment} @change=${(event: Event) => void this.view.judge(hazard, hazard.verdict, (event.target as HTMLTextAreaElement).value)}></textarea>
        </label>
        <p class="quiet">${this.say("reviewKept")}</p>
      </fieldset>
    `;
  }
}
