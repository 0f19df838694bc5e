/** Alarms that somebody has set aside: of these, nobody is told. */

import { css, html } from "lit";
import { customElement } from "lit/decorators.js";
import type { ShelfAnswer } from "./questions";
import { StatusPart } from "./status-part";

@customElement("shelf-list")
export class ShelfList extends StatusPart {
  static override styles = [
    ...StatusPart.styles,
    css`
      li {
        margin: 0.4rem 0;
        overflow-wrap: anywhere;
      }
    `,
  ];

  override render() {
    const shelves = this.view.status?.shelves ?? [];
    return html`
      <h2>${this.say("shelves")}</h2>
      ${shelves.length
        ? html`<ul>${shelves.map((one) => html`<li><strong>${this.what(one)}</strong> <span class="doubt">${this.until(one)}</span></li>`)}</ul>`
        : html`<p class="quiet">${this.say("shelvesNone")}</p>`}
    `;
  }

  private what({ stream, zone, hazard_id }: ShelfAnswer): string {
    const parts = [
      stream && this.say("shelfStream", { name: stream }),
      zone && this.say("inZone", { name: zone }),
      hazard_id && this.say("shelfHazard", { id: hazard_id }),
    ];
    return parts.filter(Boolean).join(", ") || this.say("shelfAll");
  }

  private until({ until_unix_s, author, reason }: ShelfAnswer): string {
    const at = new Date(1e3 * until_unix_s);
    const isToday = at.toDateString() === new Date().toDateString();
    const time = at.toLocaleString(this.locale, { ...(isToday ? {} : { dateStyle: "short" }), timeStyle: "short" });
    return this.say("shelfUntil", { time, author, reason });
  }
}
