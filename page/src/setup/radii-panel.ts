/** How far workers and machines reach: the circles that must not touch. */

import { html, nothing } from "lit";
import { customElement } from "lit/decorators.js";
import "./length-field";
import { SetupPart } from "./setup-part";
import type { Word } from "../shared/words";

@customElement("radii-panel")
export class RadiiPanel extends SetupPart {
  override render() {
    const draft = this.site.draft;
    if (!draft) return nothing;
    return html`
      <details>
        <summary><h2>${this.say("radii")}</h2></summary>
        ${Object.entries(this.site.usualRadius).map(
          ([name, usualM]) => html`
            <length-field
              .language=${this.language}
              .label=${this.say(name as Word)}
              .name=${name}
              .lengthM=${draft.radius_m[name] ?? usualM}
              .set=${(lengthM: number | null) =>
                this.site.change((one) => {
                  if (lengthM === null || lengthM === usualM) delete one.radius_m[name];
                  else one.radius_m[name] = lengthM;
                })}
            ></length-field>
          `,
        )}
      </details>
    `;
  }
}
