/** Zones: their names, and who may be in them. */

import { html, nothing } from "lit";
import { customElement } from "lit/decorators.js";
import { SetupPart } from "./setup-part";
import type { Draft } from "./questions";

type Kind = Draft["zones"][number]["kind"];
const KINDS: Kind[] = ["no_go", "machine_only", "crossing"];

@customElement("zones-panel")
export class ZonesPanel extends SetupPart {
  override render() {
    const draft = this.site.draft;
    if (!draft) return nothing;
    return html`
      <h2>${this.say("zones")}</h2>
      <p class="quiet">${this.say("zoneHelp")}</p>
      ${draft.zones.map(
        (zone, index) => html`
          <label class="row">${this.say("zoneName")}<input name="zone-name" .value=${zone.name} @change=${(event: Event) => this.site.change((one) => (one.zones[index]!.name = (event.target as HTMLInputElement).value))} /></label>
          <label class="row">
            ${this.say("zoneKind")}
            <select name="zone-kind" @change=${(event: Event) => this.site.change((one) => (one.zones[index]!.kind = (event.target as HTMLSelectElement).value as Kind))}>
              ${KINDS.map((kind) => html`<option value=${kind} ?selected=${kind === zone.kind}>${this.say(kind)}</option>`)}
            </select>
          </label>
          <button aria-label=${`${this.say("remove")} ${zone.name}`} @click=${() => this.site.change((one) => one.zones.splice(index, 1))}>${this.say("remove")}</button>
        `,
      )}
    `;
  }
}
