/** The ground from above: who is where now, and was just before. */

import { css, html, nothing, svg } from "lit";
import { customElement } from "lit/decorators.js";
import { TONES } from "../shared/look";
import type { Word } from "../shared/words";
import { ReviewPart } from "./review-part";

const TRAIL_S = 3;
const WIDTH = 600;
const ROUND = [0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500];
const LINES = 6;

@customElement("run-plan")
export class RunPlan extends ReviewPart {
  static override styles = [
    ...ReviewPart.styles,
    css`
      svg {
        display: block;
        width: 100%;
        border-radius: 8px;
        background: #202427;
      }
      text {
        paint-order: stroke;
        stroke: #000;
        stroke-width: 4;
        fill: #fff;
        font: 15px system-ui, sans-serif;
      }
    `,
  ];

  override render() {
    const { run, frame } = this.view;
    if (!run) return nothing;
    if (!run.plan_m) return html`<h2>${this.say("plan")}</h2><p class="quiet">${this.say("curveNone")}</p>`;
    const [left, low, right, high] = run.plan_m as [number, number, number, number];
    const perM = WIDTH / (right - left);
    const height = Math.min((high - low) * perM, WIDTH);
    const scale = Math.min(perM, height / (high - low));
    const to = (at: readonly number[]) => [(at[0]! - left) * scale + (WIDTH - (right - left) * scale) / 2, height - (at[1]! - low) * scale] as const;
    const step = ROUND.find((one) => one / run.metre >= (right - left) / LINES) ?? ROUND.at(-1)!;
    const bar = (step / run.metre) * scale;
    const before = this.view.before(TRAIL_S);
    return html`
      <h2>${this.say("plan")}</h2>
      <svg viewBox="0 0 ${WIDTH} ${height}" role="img" aria-label=${this.say("plan")}>
        ${run.zones.map((zone) => zone.rings_m.map((ring) => svg`<polygon points=${ring.map((at) => to(at).join(",")).join(" ")} fill="#ff8fd0" fill-opacity="0.12" stroke="#ff8fd0" stroke-width="2"></polygon>`))}
        ${(frame?.tracks ?? []).map((one) => {
          if (!one.at_m) return nothing;
          const tone = TONES[one.severity ?? "none"];
          const trail = before.flatMap((past) => past.tracks.filter((other) => other.track_id === one.track_id && other.at_m).map((other) => to(other.at_m!).join(",")));
          const [x, y] = to(one.at_m);
          return svg`
            <polyline points=${trail.join(" ")} fill="none" stroke=${tone} stroke-opacity="0.7" stroke-width="2"></polyline>
            <circle cx=${x} cy=${y} r=${one.radius_m * scale} fill=${tone} fill-opacity="0.15" stroke=${tone} stroke-width="1.5"></circle>
            <circle cx=${x} cy=${y} r="4" fill=${tone} stroke="#000"></circle>
            <text x=${x + 7} y=${y + 5}>${this.say(one.kind as Word)} ${one.track_id}</text>`;
        })}
        <path d="M 14 ${height - 14} h ${bar}" stroke="#000" stroke-width="7"></path>
        <path d="M 14 ${height - 14} h ${bar}" stroke="#fff" stroke-width="3"></path>
        <text x="14" y=${height - 22}>${step} ${run.unit}</text>
      </svg>
    `;
  }
}
