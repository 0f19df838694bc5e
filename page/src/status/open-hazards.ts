/** All hazards that are open, the gravest first. */

import { css, html, nothing } from "lit";
import { customElement } from "lit/decorators.js";
import { TONES } from "../shared/look";
import type { Word } from "../shared/words";
import { StatusPart } from "./status-part";
import type { OpenHazard } from "./status-view";

@customElement("open-hazards")
export class OpenHazards extends StatusPart {
  static override styles = [
    ...StatusPart.styles,
    css`
      h2 {
        font-size: 1.2rem;
      }
      li {
        padding: 0.4rem 0 0.4rem 0.6rem;
        border-left: 0.5rem solid var(--tone);
        margin: 0.5rem 0;
        overflow-wrap: anywhere;
      }
      .danger {
        font-size: 1.15rem;
      }
      .danger .pill {
        text-transform: uppercase;
      }
      .who {
        font-weight: 600;
      }
      p {
        margin: 0.1rem 0;
      }
      .numbers {
        font-variant-numeric: tabular-nums;
      }
    `,
  ];

  override render() {
    const { hazards, isCurrent } = this.view;
    return html`
      <h2>${this.say("openHazards")}</h2>
      ${isCurrent ? nothing : html`<p class="wrong">${hazards.length ? this.say("openHazardsOld") : this.blind()}</p>`}
      ${hazards.length ? html`<ol class="plain">${hazards.map((one) => this.row(one))}</ol>` : isCurrent ? this.none() : nothing}
    `;
  }

  private none() {
    return this.view.unwatched ? html`<p class="wrong">${this.blind()}</p>` : html`<p class="good">✓ ${this.say("openHazardsNone")}</p>`;
  }

  private blind(): string {
    const { status, unwatched } = this.view;
    return this.say("openHazardsBlind", { n: unwatched, all: status?.streams.length ?? 0 });
  }

  private row(hazard: OpenHazard) {
    const { severity, stream, zone, rule } = hazard;
    return html`<li class=${severity} .style=${`--tone:${TONES[severity]}`}>
      <p><span class="pill" .style=${`background:${TONES[severity]}`}>${this.say(severity)}</span> ${this.say(`rule_${rule}` as Word)} · ${stream.name}</p>
      <p class="who">${this.who(hazard)}${zone ? html` · ${this.say("inZone", { name: zone })}` : nothing}</p>
      ${this.measured(hazard)}
    </li>`;
  }

  private who({ track_ids, stream, rule }: OpenHazard): string {
    const names = track_ids.map((id) => {
      const seen = stream.tracks.find((one) => one.id === id);
      return seen ? `${this.say(seen.kind as Word)} ${id}` : this.say("track", { n: id });
    });
    if (rule === "proximity" && names.length === 1) names.push(this.say("perhapsSomebody"));
    return names.join(" · ") || this.say("wholeStream");
  }

  /** A number of a stream that nobody watches is no number. */
  private measured({ phase, distance_m, sigma_m, gap_m, reason, stream }: OpenHazard) {
    const { view } = this;
    if (!view.isCurrent) return html`<p class="doubt">${this.say("notMeasured", { reason: this.say("noAnswerWhy") })}</p>`;
    const isWatched = view.isWatched(stream);
    if (!isWatched || phase === "unknown" || distance_m === null) {
      const why = reason || (isWatched ? "" : stream.reason) || this.say("notKnown");
      return html`<p class="doubt">${this.say("notMeasured", { reason: why })}</p>`;
    }
    const distance = `${this.number(distance_m)}${sigma_m === null ? "" : ` ± ${this.number(sigma_m)}`}`;
    return html`<p class="numbers">${this.say("measured", { distance, gap: gap_m === null ? this.say("notKnown") : this.number(gap_m) })}</p>`;
  }
}
