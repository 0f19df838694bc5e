/** What the server makes of the draft in this picture: metres or why not, how sure, what contradicts what. */

import { html, nothing } from "lit";
import { customElement } from "lit/decorators.js";
import { SetupPart } from "./setup-part";

@customElement("result-panel")
export class ResultPanel extends SetupPart {
  override render() {
    const { ground, isLooking, tape, tapeEnds } = this.site;
    return html`
      <h2>${this.say("result")}</h2>
      <div role="status" aria-live="polite">
        ${isLooking && !ground ? html`<p class="quiet">${this.say("looking")}</p>` : nothing} ${ground ? this.answer() : nothing}
        ${tape ? html`<p>${this.say("tape")}: <strong id="tape">${tape.text || this.say("tapeNone")}</strong></p>` : nothing}
      </div>
      ${ground?.found && tapeEnds.length < 2 ? html`<p class="quiet">${this.say("tapeHelp")}</p>` : nothing}
    `;
  }

  private answer() {
    const ground = this.site.ground!;
    if (ground.missing) return html`<p>${this.missing(ground.missing)}</p>`;
    if (!ground.found) return html`<p class="wrong">${this.say("notFound")} ${ground.reason}</p>${this.doubts()}`;
    const share = ground.watched ? `${Math.round(100 * ground.watched.share)} %` : "";
    return html`
      <p class="good">✓ ${this.say("found")}${ground.is_rough ? html` <span class="quiet">${this.say("rough")}</span>` : nothing}</p>
      ${ground.camera_height_text ? html`<p>${this.say("cameraUp", { height: ground.camera_height_text })}</p>` : nothing}
      ${ground.off_px != null ? html`<p class="quiet">${this.say("clicksOff", { px: ground.off_px.toFixed(1) })}</p>` : nothing}
      ${share ? html`<p>${this.say("watchedShare", { share })}</p>` : nothing}
      ${ground.contours.length ? html`<p class="quiet">${this.say("sureLines")} ${ground.contours.map((one) => `± ${one.text}`).join(", ")}</p>` : nothing}
      ${this.doubts()}
    `;
  }

  private doubts() {
    const { warnings } = this.site.ground!;
    return warnings.length
      ? html`<p class="doubt">⚠ ${this.say("doubts")}</p>
          <ul>
            ${warnings.map((one) => html`<li>${one}</li>`)}
          </ul>`
      : nothing;
  }

  private missing(missing: string): string {
    const [what, left] = missing.split(": ");
    if (what === "corners") return this.say("clickCorner", { n: 5 - Number(left) });
    if (what === "points") return this.say("pointsMore", { n: left ?? "" });
    return this.say("typeLengths");
  }
}
