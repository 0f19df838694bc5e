/** Write the settings, and say what to type next. */

import { html, nothing } from "lit";
import { customElement } from "lit/decorators.js";
import { SetupPart } from "./setup-part";

@customElement("save-panel")
export class SavePanel extends SetupPart {
  override render() {
    const { siteFile, savedAs, ground, draft } = this.site;
    if (!draft) return nothing;
    return html`
      <h2>${this.say("save")}</h2>
      <button id="save" class="main" ?disabled=${!ground?.found} @click=${() => void this.site.save()}>${this.say("saveTo", { file: siteFile })}</button>
      <p class="quiet">${this.say("kept")}</p>
      <div role="status">${savedAs ? html`<p class="good">✓ ${this.say("saved")}</p><code>${savedAs.command}</code>` : nothing}</div>
    `;
  }
}
