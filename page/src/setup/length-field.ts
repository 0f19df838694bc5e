/** A field for a length: typed in any unit, kept in metres, and shown again in the unit of the page. */

import { html } from "lit";
import { customElement, property, state } from "lit/decorators.js";
import { SetupPart } from "./setup-part";
import { ask } from "./questions";

@customElement("length-field")
export class LengthField extends SetupPart {
  @property() label = "";
  @property() name = "";
  @property({ attribute: false }) lengthM: number | null = null;
  @property({ attribute: false }) usualM: number | null = null;
  @property({ attribute: false }) set: (lengthM: number | null) => void = () => {};
  @state() private text = "";
  @state() private wrong = "";
  private shownM: number | null | undefined;
  private shownUnit = "";

  override willUpdate(): void {
    const unit = this.site.draft?.unit ?? "metres";
    const isShown = this.shownM !== undefined && this.shownUnit === unit && this.shownM === this.lengthM;
    if (isShown) return;
    this.shownM = this.lengthM;
    this.shownUnit = unit;
    if (this.lengthM === null) this.text = "";
    else
      void ask.lengthText(unit, this.lengthM).then((answer) => {
        // Unless another unit was chosen meanwhile.
        if (this.shownUnit === unit) this.text = answer.text;
      });
  }

  private async take(text: string): Promise<void> {
    this.wrong = "";
    this.text = text;
    if (!text.trim()) return this.give(null);
    try {
      const unit = this.site.draft!.unit;
      const answer = await ask.length(unit, text);
      this.text = answer.text;
      this.shownUnit = unit;
      this.give(answer.length_m);
    } catch (error) {
      this.wrong = error instanceof Error ? error.message : String(error);
    }
  }

  private give(lengthM: number | null): void {
    this.shownM = lengthM;
    this.lengthM = lengthM;
    this.set(lengthM);
  }

  override render() {
    const usual = this.usualM === null ? "" : String(this.usualM);
    return html`
      <label class="row">
        ${this.label}
        <input
          name=${this.name}
          .value=${this.text}
          placeholder=${usual}
          inputmode="text"
          autocomplete="off"
          aria-invalid=${this.wrong ? "true" : "false"}
          @change=${(event: Event) => void this.take((event.target as HTMLInputElement).value)}
        />
      </label>
      ${this.wrong ? html`<p class="wrong" role="alert">${this.wrong}</p>` : ""}
    `;
  }
}
