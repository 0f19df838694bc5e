/** One stream: whether it is watched and if not why, what it sees, and how good that is. */

import { css, html, nothing } from "lit";
import { customElement, property } from "lit/decorators.js";
import { TONES } from "../shared/look";
import type { Word } from "../shared/words";
import type { StreamAnswer } from "./questions";
import { MARKS, StatusPart } from "./status-part";
import { SEVERITIES } from "./status-view";
import "./stream-picture";

@customElement("stream-card")
export class StreamCard extends StatusPart {
  static override styles = [
    ...StatusPart.styles,
    css`
      article {
        height: 100%;
        box-sizing: border-box;
        background: var(--panel);
        border: 1px solid var(--line);
        border-radius: 10px;
        overflow: hidden;
      }
      .blind {
        border: 4px solid var(--alarm);
      }
      .head,
      .facts {
        padding: 0.5rem 0.8rem;
      }
      h3 {
        margin: 0;
        font-size: 1rem;
        overflow-wrap: anywhere;
      }
      .title {
        display: flex;
        flex-wrap: wrap;
        gap: 0.2rem 0.6rem;
        justify-content: space-between;
      }
      .title .pill {
        text-transform: uppercase;
      }
      .state {
        margin: 0.1rem 0;
        font-size: 1.5rem;
        font-weight: 700;
        line-height: 1.2;
      }
      .blind .state {
        font-size: 2rem;
        text-transform: uppercase;
      }
      .why {
        font-size: 1.1rem;
        font-weight: 600;
        overflow-wrap: anywhere;
      }
      .facts {
        font-size: 0.9rem;
      }
    `,
  ];

  @property({ attribute: false }) stream!: StreamAnswer;

  override render() {
    const { stream, language } = this;
    const tone = this.tone(stream);
    const word = ({ good: "watched", doubt: "watchedLimits", bad: "notWatched" } as const)[tone];
    return html`<article class=${tone === "bad" ? "blind" : ""} aria-label=${stream.name}>
      <div class="head ${tone === "bad" ? "alarm" : ""}">
        <div class="title">
          <h3>${stream.name}</h3>
          ${this.worst()}
        </div>
        <p class="state ${tone === "bad" ? "" : tone}">${MARKS[tone]} ${this.say(word)}</p>
        ${tone === "bad" ? this.reason() : this.limits(stream).map((one) => html`<p class="doubt">${one}</p>`)}
      </div>
      <stream-picture .language=${language} .stream=${stream}></stream-picture>
      <div class="facts">${this.facts()}</div>
    </article>`;
  }

  private worst() {
    const { stream, view } = this;
    const found = view.isCurrent ? SEVERITIES.find((grave) => stream.hazards.some((one) => one.severity === grave)) : undefined;
    return found ? html`<span class="pill" .style=${`background:${TONES[found]}`}>${this.say(found)}</span>` : nothing;
  }

  private reason() {
    const { state, reason } = this.stream;
    if (!this.view.isCurrent) return html`<p class="why">${this.say("noAnswerWhy")}</p>`;
    return html`<p class="why">${this.say(`stream_${state}`)}${reason ? html`: <span lang="en">${reason}</span>` : nothing}</p>`;
  }

  private facts() {
    const { stream } = this;
    const isWatched = this.view.isWatched(stream);
    return html`
      <dl>
        ${isWatched ? this.now() : nothing}
        <dt>${this.say("taken")}</dt>
        <dd class=${stream.delay === "unknown" ? "doubt" : ""}>${this.taken()}</dd>
        <dt>${this.say("toResult")}</dt>
        <dd>${this.quantiles(stream.arrival_to_result_ms)}</dd>
        <dt>${this.say("pictures")}</dt>
        <dd>${this.say("picturesLooked", { n: this.number(stream.frames, 0), missed: this.number(stream.not_looked_at, 0) })}</dd>
      </dl>
    `;
  }

  /** What is true only while somebody looks. */
  private now() {
    const { stream } = this;
    const share = stream.watched_share;
    const lost = Object.entries(stream.unwatched).filter(([, part]) => part >= 0.005);
    return html`
      <dt>${this.say("inSight")}</dt>
      <dd>${this.inSight() || this.say("nobodyInSight")}</dd>
      <dt>${this.say("map")}</dt>
      <dd class=${stream.map ? "" : "doubt"}>
        ${stream.map || html`${this.say("mapNone")}${stream.map_reason ? html`: <span lang="en">${stream.map_reason}</span>` : nothing}`}
      </dd>
      <dt>${this.say("groundWatched")}</dt>
      <dd class=${share === null ? "doubt" : ""}>
        ${share === null ? this.say("notKnown") : this.percent(share)}
        ${lost.length ? html`<span class="quiet" lang="en">(${lost.map(([reason, part]) => `${reason} ${Math.round(100 * part)}\u00a0%`).join(", ")})</span>` : nothing}
      </dd>
    `;
  }

  /** When the newest picture that was looked at was taken, and how that is known. */
  private taken(): string {
    const { delay, captured_age_ms } = this.stream;
    const { isCurrent } = this.view;
    // Of a stream that is watched, its head says it already.
    if (delay === "unknown" && isCurrent && !this.view.isWatched(this.stream)) return this.say("delay_unknown");
    if (delay === "unknown" || captured_age_ms === null || !isCurrent) return this.say("notKnown");
    return `${this.say("ago", { age: this.lasting(captured_age_ms) })}, ${this.say(`delay_${delay}`)}`;
  }

  private inSight(): string {
    const counts = new Map<string, number>();
    for (const { kind } of this.stream.tracks) counts.set(kind, (counts.get(kind) ?? 0) + 1);
    return [...counts].map(([kind, count]) => `${count} × ${this.say(kind as Word)}`).join(", ");
  }
}
