/** A stream's newest picture; one that is old, or of a stream that is not watched, cannot be taken for what is now. */

import { css, html, nothing, svg } from "lit";
import { customElement, property, state } from "lit/decorators.js";
import { labelsOver } from "../shared/labels";
import { lettersOver, TONES } from "../shared/look";
import type { Word } from "../shared/words";
import { ask, type StreamAnswer } from "./questions";
import { StatusPart } from "./status-part";
import { Moment, SEVERITIES } from "./status-view";

const EVERY_MS = { watched: 500, unwatched: 2000 };
/** A tick of the page comes a little early or late. */
const EARLY_MS = 60;
const OLD_MS = 3000;

interface Shown {
  address: string;
  asked: Moment;
  wasMs: number;
}

@customElement("stream-picture")
export class StreamPicture extends StatusPart {
  static override styles = [
    ...StatusPart.styles,
    lettersOver,
    css`
      .frame {
        position: relative;
        aspect-ratio: 16 / 9;
        background: #101214;
        color: #ffffff;
        overflow: hidden;
      }
      img,
      svg,
      .veil {
        position: absolute;
        inset: 0;
        width: 100%;
        height: 100%;
      }
      img {
        object-fit: contain;
      }
      .old img {
        filter: grayscale(1) brightness(0.7);
      }
      .veil {
        box-sizing: border-box;
        display: grid;
        place-content: center;
        justify-items: center;
        gap: 0.3rem;
        padding: 0.5rem;
        text-align: center;
        background: repeating-linear-gradient(-45deg, transparent 0 18px, rgb(0 0 0 / 30%) 18px 36px);
      }
      p {
        margin: 0;
        background: rgb(0 0 0 / 75%);
        border-radius: 6px;
        padding: 0.1rem 0.6rem;
        font-variant-numeric: tabular-nums;
      }
      .veil p {
        font-size: 1.3rem;
        font-weight: 700;
      }
      .veil p:first-child {
        font-size: 1.7rem;
        text-transform: uppercase;
      }
      .age {
        position: absolute;
        left: 0.4rem;
        bottom: 0.4rem;
        font-size: 0.9rem;
      }
    `,
  ];

  @property({ attribute: false }) stream!: StreamAnswer;
  @state() private shown?: Shown;
  private asked?: Moment;
  private isFetching = false;

  override updated(): void {
    void this.look();
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    if (this.shown) URL.revokeObjectURL(this.shown.address);
    delete this.shown;
  }

  private async look(): Promise<void> {
    const { view, stream } = this;
    const everyMs = EVERY_MS[view.isWatched(stream) ? "watched" : "unwatched"];
    const isTime = (this.asked?.agoMs ?? Number.POSITIVE_INFINITY) >= everyMs - EARLY_MS;
    if (this.isFetching || !isTime || !view.isCurrent || document.hidden || stream.picture_age_ms === null) return;
    this.isFetching = true;
    const asked = (this.asked = new Moment());
    try {
      const { picture, age_ms } = await ask.picture(stream.name);
      const address = URL.createObjectURL(picture);
      if (this.isConnected && (await isPicture(address))) {
        if (this.shown) URL.revokeObjectURL(this.shown.address);
        this.shown = { address, asked, wasMs: age_ms };
      } else {
        URL.revokeObjectURL(address);
      }
    } catch {
      // The one before stays, and says how old it is.
    } finally {
      this.isFetching = false;
    }
  }

  override render() {
    const { shown, stream } = this;
    const ageMs = shown ? shown.wasMs + shown.asked.agoMs : Number.NaN;
    const isWatched = this.view.isWatched(stream);
    const isNow = isWatched && ageMs <= OLD_MS;
    const age = Number.isNaN(ageMs) ? this.say("notKnown") : this.lasting(ageMs);
    const picture = shown ? html`<img alt=${this.say("pictureOf", { name: stream.name })} src=${shown.address} />` : nothing;
    if (isNow) return html`<div class="frame">${picture}${this.boxes()}<p class="age">${this.say("pictureAge", { age })}</p></div>`;
    return html`<div class="frame old">
      ${picture}
      <div class="veil">
        ${isWatched ? (shown ? html`<p>${this.say("pictureOld")}</p>` : nothing) : html`<p>${this.say("notWatched")}</p>`}
        <p>${shown ? this.say("pictureAged", { age }) : this.say("pictureNone")}</p>
      </div>
    </div>`;
  }

  private boxes() {
    const { size_px, tracks, hazards } = this.stream;
    if (!size_px) return nothing;
    const [widthPx, heightPx] = size_px as [number, number];
    const thin = Math.max(widthPx / 500, (1.5 * widthPx) / (this.clientWidth || widthPx));
    const labels = labelsOver(widthPx, this.clientWidth);
    return html`<svg viewBox="0 0 ${widthPx} ${heightPx}" aria-hidden="true">
      ${tracks.map((one) => {
        const [left, top, right, bottom] = one.xyxy_px as [number, number, number, number];
        const severity = SEVERITIES.find((grave) => hazards.some((hazard) => hazard.severity === grave && hazard.track_ids.includes(one.id)));
        // Around what is small, not over it.
        const line = (severity ? 2 : 1) * thin;
        const [x, y, width, height] = [left - line, top - line, right - left + 2 * line, bottom - top + 2 * line];
        return svg`
          <rect x=${x} y=${y} width=${width} height=${height} fill="none" stroke="#000" stroke-opacity="0.6" stroke-width=${line + 1.5 * thin}></rect>
          <rect x=${x} y=${y} width=${width} height=${height} fill="none" stroke=${TONES[severity ?? "none"]} stroke-width=${line}></rect>
        `;
      })}
      ${tracks.map((one) => {
        const [left, top, right] = one.xyxy_px as [number, number, number, number];
        return labels.put([(left + right) / 2, Math.max(top - 5 * thin - labels.size / 4, labels.size)], `${this.say(one.kind as Word)} ${one.id}`);
      })}
    </svg>`;
  }
}

/** Whether there is a picture; it is ready to be shown then. */
async function isPicture(address: string): Promise<boolean> {
  const image = new Image();
  image.src = address;
  return image.decode().then(
    () => true,
    () => false,
  );
}
