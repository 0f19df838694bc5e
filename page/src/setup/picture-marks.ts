/** What is drawn over the film's picture: lines, labels, and what the server says of the ground. */

import { nothing, svg, type SVGTemplateResult } from "lit";
import type { Word } from "../shared/words";
import type { FilmAnswer, GroundAnswer, Pixel } from "./questions";

const LETTER_PX = 14;

/** Draws in pixels of the picture, as thick as it should look on the screen. */
export class PictureMarks {
  constructor(
    private readonly film: FilmAnswer,
    private readonly screenPx: number,
    private readonly say: (word: Word) => string,
  ) {}

  line(points: Pixel[], colour: string, width: number, dashes = ""): SVGTemplateResult {
    const path = points.map(([x, y]) => `${x},${y}`).join(" ");
    return svg`
      <polyline points=${path} fill="none" stroke="#000" stroke-opacity="0.6" stroke-width=${(width + 2) * this.screenPx}></polyline>
      <polyline points=${path} fill="none" stroke=${colour} stroke-width=${width * this.screenPx} stroke-dasharray=${dashes}></polyline>
    `;
  }

  label(at: Pixel, text: string, anchor = "start"): SVGTemplateResult {
    const size = LETTER_PX * this.screenPx;
    return svg`<text x=${at[0]} y=${at[1]} font-size=${size} stroke-width=${size / 4} text-anchor=${anchor}>${text}</text>`;
  }

  unwatched(ground: GroundAnswer): SVGTemplateResult {
    const watched = ground.watched;
    const film = this.film;
    if (!watched) return svg``;
    const width = film.width_px / watched.columns;
    const height = film.height_px / watched.rows;
    const cells = watched.cells.flatMap((row, r) => row.map((reason, c) => [r, c, reason] as const)).filter(([, , reason]) => reason > 0);
    return svg`${cells.map(
      ([r, c, reason]) => svg`
        <rect x=${c * width - 0.5} y=${r * height - 0.5} width=${width} height=${height} fill="url(#hatch)">
          <title>${watched.reasons[reason] ?? ""}</title>
        </rect>`,
    )}`;
  }

  contours(ground: GroundAnswer): SVGTemplateResult {
    return svg`${ground.contours.map((contour) =>
      contour.lines_px.map((points) => {
        const line = points as Pixel[];
        const middle = line[Math.floor(line.length / 2)];
        return svg`${this.line(line, "#ffe08a", 1.5, `${8 * this.screenPx} ${5 * this.screenPx}`)}
          ${middle ? this.label(middle, `± ${contour.text}`) : nothing}`;
      }),
    )}`;
  }

  circles(ground: GroundAnswer): SVGTemplateResult {
    return svg`${ground.entities.map((one) => {
      const [left, top, right, bottom] = one.box_px;
      return svg`
        <rect x=${left} y=${top} width=${right - left} height=${bottom - top} fill="none" stroke="#fff" stroke-width=${this.screenPx}></rect>
        ${this.line(one.circle_px as Pixel[], "#b7f36b", 1.5)}
        ${this.label([left, top - 4 * this.screenPx], this.say(one.kind as Word))}
      `;
    })}`;
  }
}
