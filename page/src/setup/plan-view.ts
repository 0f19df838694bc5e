/** The ground from above, with who stands where. */

import { css, html, nothing, svg } from "lit";
import { customElement } from "lit/decorators.js";
import { SetupPart } from "./setup-part";
import type { Pixel } from "./questions";

const BAR_SHARE = 0.3;
const ROUND_M = [0.5, 1, 2, 5, 10, 20, 50, 100];

@customElement("plan-view")
export class PlanView extends SetupPart {
  static override styles = [
    ...SetupPart.styles,
    css`
      svg {
        display: block;
        width: 100%;
        border-radius: 8px;
        background: #202020;
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
    const { ground, plan, draft } = this.site;
    const about = ground?.plan;
    if (!about || !plan || !draft) return html`<h2>${this.say("plan")}</h2><p class="quiet">${this.say("planNone")}</p>`;
    const to = (at: readonly number[]): Pixel => {
      const [first, second] = about.to_plan as [number[], number[]];
      const [x, y] = at as Pixel;
      return [first[0]! * x + first[1]! * y + first[2]!, second[0]! * x + second[1]! * y + second[2]!];
    };
    const barM = [...ROUND_M].reverse().find((one) => one / about.m_per_px <= BAR_SHARE * about.width_px) ?? ROUND_M[0]!;
    const bar = barM / about.m_per_px;
    return html`
      <h2>${this.say("plan")}</h2>
      <svg viewBox="0 0 ${about.width_px} ${about.height_px}" role="img" aria-label=${this.say("plan")}>
        <image href=${plan} width=${about.width_px} height=${about.height_px}></image>
        ${draft.zones.map((zone) => svg`
          <polygon points=${zone.ring_m.map((one) => to(one).join(",")).join(" ")} fill="#ff8fd0" fill-opacity="0.15" stroke="#ff8fd0" stroke-width="2"></polygon>`)}
        ${(ground?.entities ?? []).map((one) => {
          if (!one.at_m) return nothing;
          const [x, y] = to(one.at_m);
          return svg`<circle cx=${x} cy=${y} r="5" fill="#b7f36b" stroke="#000"></circle><text x=${x + 8} y=${y + 5}>${this.say(one.kind as "worker")}</text>`;
        })}
        <path d="M 14 ${about.height_px - 14} h ${bar}" stroke="#000" stroke-width="7"></path>
        <path d="M 14 ${about.height_px - 14} h ${bar}" stroke="#fff" stroke-width="3"></path>
        <text x="14" y=${about.height_px - 22}>${barM} m</text>
      </svg>
    `;
  }
}
