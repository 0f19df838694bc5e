/** Texts over a picture. */

import { nothing, svg, type SVGTemplateResult } from "lit";

export type Pixel = [number, number];
const TEXT_SHARE = 0.015;
const LEAST_TEXT_PX = 12;
const LETTER_SHARE = 0.55;

/** Texts; one that would lie over another is left out, those put first stay. */
export class Labels {
  private readonly taken: [number, number, number, number][] = [];

  constructor(
    readonly size: number,
    private readonly widthPx: number,
  ) {}

  put(at: Pixel, text: string): SVGTemplateResult | typeof nothing {
    const half = (LETTER_SHARE * this.size * text.length) / 2;
    const x = Math.min(Math.max(at[0], half), this.widthPx - half);
    const box: [number, number, number, number] = [x - half, at[1] - this.size, x + half, at[1]];
    if (this.taken.some(([left, top, right, bottom]) => box[0] < right && left < box[2] && box[1] < bottom && top < box[3])) return nothing;
    this.taken.push(box);
    return svg`<text x=${x} y=${at[1]} font-size=${this.size} stroke-width=${this.size / 4} text-anchor="middle">${text}</text>`;
  }
}

/** Of a picture that is shown so large: on a small screen letters stay readable, and fewer of them find room. */
export function labelsOver(widthPx: number, shownPx: number): Labels {
  return new Labels(Math.max(TEXT_SHARE * widthPx, (LEAST_TEXT_PX * widthPx) / (shownPx || widthPx)), widthPx);
}
