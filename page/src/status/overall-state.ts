/** How the site is, in one line that is always in sight. */

import { css, html, nothing } from "lit";
import { customElement } from "lit/decorators.js";
import { TONES } from "../shared/look";
import type { Word } from "../shared/words";
import { MARKS, StatusPart, type Tone } from "./status-part";
import { SEVERITIES } from "./status-view";

@customElement("overall-state")
export class OverallState extends StatusPart {
  static override styles = [
    ...StatusPart.styles,
    css`
      .line {
        display: flex;
        flex-wrap: wrap;
        gap: 0.2rem 1.2rem;
        align-items: center;
        justify-content: space-between;
        padding: 0.5rem 1rem;
        border-bottom: 1px solid var(--line);
        background: var(--panel);
      }
      .line.alarm {
        background: var(--alarm);
      }
      .good,
      .doubt {
        border-left: 0.6rem solid currentcolor;
      }
      .overall {
        margin: 0;
        font-size: clamp(1.25rem, 2.2vw, 2rem);
        font-weight: 700;
        line-height: 1.25;
      }
      .open {
        display: flex;
        flex-wrap: wrap;
        gap: 0.4rem 0.6rem;
        align-items: center;
      }
      .pill {
        font-size: clamp(1rem, 1.6vw, 1.4rem);
      }
      .danger {
        font-size: clamp(1.2rem, 2.2vw, 2rem);
        text-transform: uppercase;
      }
    `,
  ];

  override render() {
    const { view } = this;
    if (view.isSilent) {
      // The seconds are not for ears: they would be read out every second.
      return html`<div class="line alarm">
        <p class="overall" aria-hidden="true">${MARKS.bad} ${this.say("noAnswer", { age: this.lasting(view.silentMs, 0) })}</p>
        <div role="alert" class="unseen">${this.say("noAnswerSaid")}</div>
        <div role="status" class="unseen"></div>
      </div>`;
    }
    const { status } = view;
    if (!status) return html`<div class="line"><p class="overall">${this.say("looking")}</p></div>`;
    const [tone, word] = this.found();
    const said = html`<p class="overall">${MARKS[tone]} ${this.say(word)}</p>`;
    const counts = SEVERITIES.map((one) => [one, view.hazards.filter((hazard) => hazard.severity === one).length] as const);
    const pills = counts.map(([one, count]) => (count ? html`<span class="pill ${one}" .style=${`background:${TONES[one]}`}>${count} × ${this.say(one)}</span>` : nothing));
    return html`<div class="line ${tone === "bad" ? "alarm" : tone}">
      <div>
        <div role="alert">${tone === "bad" ? said : nothing}</div>
        <div role="status">${tone === "bad" ? nothing : said}</div>
      </div>
      <div class="open">
        <div role="alert">${pills[0]}</div>
        <div role="status" class="open">${pills.slice(1)}</div>
      </div>
    </div>`;
  }

  private found(): [Tone, Word] {
    const { status, unwatched } = this.view;
    const { overall, streams, devices } = status!;
    if (overall === "failing") return ["bad", "notWorking"];
    if (overall !== "ok" || unwatched) return ["bad", "notAllWatched"];
    const isLimited = streams.some((one) => this.limits(one).length) || devices.some((one) => !one.supervised);
    return isLimited ? ["doubt", "allWatchedLimits"] : ["good", "allWatched"];
  }
}
