/** Where the metres come from: something of known size, surveyed points, or what is found by itself. */

import { html, nothing } from "lit";
import { customElement, state } from "lit/decorators.js";
import "./length-field";
import { SetupPart } from "./setup-part";
import type { Draft } from "./questions";
import type { Word } from "../shared/words";

type Shape = Draft["reference"]["shape"];
const LENGTHS: Record<Shape, Word[]> = {
  square: ["side"],
  rectangle: ["length", "width"],
  sides: ["side12", "side23", "side34", "side41", "diagonal13"],
};
const BASES: [Draft["ground"], Word][] = [
  ["reference", "basisReference"],
  ["survey", "basisSurvey"],
  ["auto", "basisAuto"],
];
const SHAPES: [Shape, Word][] = [
  ["square", "shapeSquare"],
  ["rectangle", "shapeRectangle"],
  ["sides", "shapeSides"],
];

@customElement("basis-panel")
export class BasisPanel extends SetupPart {
  @state() private pasted = "";
  @state() private inDegrees = false;

  override render() {
    const draft = this.site.draft;
    if (!draft) return nothing;
    return html`
      <fieldset>
        <legend><h2>${this.say("basis")}</h2></legend>
        ${BASES.map(
          ([basis, word]) => html`
            <label>
              <input type="radio" name="basis" value=${basis} .checked=${draft.ground === basis} @change=${() => this.site.change((one) => (one.ground = basis))} />
              ${this.say(word)}
            </label>
          `,
        )}
        ${draft.ground === "reference" ? this.reference(draft) : draft.ground === "survey" ? this.survey(draft) : html`<p class="quiet">${this.say("basisAutoHelp")}</p>`}
      </fieldset>
    `;
  }

  private reference(draft: Draft) {
    const { reference } = draft;
    const words = LENGTHS[reference.shape];
    const count = reference.corners_px.length;
    return html`
      <label class="row">
        ${this.say("shape")}
        <select
          name="shape"
          @change=${(event: Event) =>
            this.site.change((one) => {
              one.reference.shape = (event.target as HTMLSelectElement).value as Shape;
              one.reference.lengths_m = LENGTHS[one.reference.shape].map(() => null);
            })}
        >
          ${SHAPES.map(([shape, word]) => html`<option value=${shape} ?selected=${shape === reference.shape}>${this.say(word)}</option>`)}
        </select>
      </label>
      ${words.map(
        (word, k) => html`
          <length-field
            .language=${this.language}
            .label=${this.say(word)}
            .name=${word}
            .lengthM=${reference.lengths_m[k] ?? null}
            .set=${(lengthM: number | null) =>
              this.site.change((one) => {
                one.reference.lengths_m = words.map((_, n) => (n === k ? lengthM : (one.reference.lengths_m[n] ?? null)));
              })}
          ></length-field>
        `,
      )}
      <length-field
        .language=${this.language}
        .label=${this.say("height")}
        .name=${"height"}
        .lengthM=${reference.height_m ?? null}
        .set=${(lengthM: number | null) => this.site.change((one) => (one.reference.height_m = lengthM))}
      ></length-field>
      <p class="quiet">${this.say("heightHelp")}</p>
      <p aria-live="polite">${count < 4 ? this.say("clickCorner", { n: count + 1 }) : this.say("moveCorners")}</p>
      ${count ? html`<button @click=${() => this.site.change((one) => (one.reference.corners_px = []))}>${this.say("again")}</button>` : nothing}
    `;
  }

  private survey(draft: Draft) {
    const next = draft.survey.points.find((point) => !point.at_px);
    return html`
      <label>
        ${this.say("pastePoints")}
        <textarea name="points" rows="4" cols="34" .value=${this.pasted} @input=${(event: Event) => (this.pasted = (event.target as HTMLTextAreaElement).value)}></textarea>
      </label>
      <label><input type="checkbox" .checked=${this.inDegrees} @change=${(event: Event) => (this.inDegrees = (event.target as HTMLInputElement).checked)} />${this.say("inDegrees")}</label>
      <button ?disabled=${!this.pasted.trim()} @click=${() => this.takePoints()}>${this.say("paste")}</button>
      <ul>
        ${draft.survey.points.map(
          (point, index) => html`<li>
            ${point.name}: ${(point.m ?? point.lonlat ?? []).join(", ")}${point.z_m == null ? "" : `, ${point.z_m}`} ${point.at_px ? "✓" : ""}
            <button aria-label=${`${this.say("remove")} ${point.name}`} @click=${() => this.site.change((one) => one.survey.points.splice(index, 1))}>✕</button>
          </li>`,
        )}
      </ul>
      ${next ? html`<p aria-live="polite">${this.say("clickPoint", { name: next.name })}</p>` : nothing}
    `;
  }

  private takePoints(): void {
    const rows = this.pasted
      .split("\n")
      .map((line) => line.split(/[\t;,]/).map((cell) => cell.trim()))
      .filter((cells) => cells.length >= 3 && cells.slice(1, 3).every((cell) => cell !== "" && Number.isFinite(Number(cell))));
    const points = rows.map(([name, x, y, z]) => {
      const place: [number, number] = [Number(x), Number(y)];
      const known = this.inDegrees ? { m: null, lonlat: place } : { m: place, lonlat: null };
      return { name: name || "?", at_px: null, z_m: z && Number.isFinite(Number(z)) ? Number(z) : null, ...known };
    });
    this.site.change((one) => one.survey.points.push(...points));
    if (points.length) this.pasted = "";
  }
}
