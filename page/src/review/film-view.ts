/** The film, with what was measured drawn over it from the tables. */

import { css, html, nothing, svg, type SVGTemplateResult } from "lit";
import { customElement, query, state } from "lit/decorators.js";
import { labelsOver, type Pixel } from "../shared/labels";
import { lettersOver, TONES } from "../shared/look";
import type { Word } from "../shared/words";
import type { FrameAt } from "./questions";
import { clock, ReviewPart } from "./review-part";

const SPEEDS = [0.25, 0.5, 1, 2, 4];

@customElement("film-view")
export class FilmView extends ReviewPart {
  static override styles = [
    ...ReviewPart.styles,
    lettersOver,
    css`
      .frame {
        position: relative;
        background: #000;
        border-radius: 8px;
        overflow: hidden;
      }
      video,
      img {
        display: block;
        width: 100%;
      }
      svg {
        position: absolute;
        inset: 0;
        width: 100%;
        height: 100%;
      }
      .bar {
        display: flex;
        flex-wrap: wrap;
        gap: 0.5rem;
        align-items: center;
        margin-top: 0.5rem;
      }
      .bar input[type="range"] {
        flex: 1 1 12rem;
        padding: 0;
        accent-color: var(--accent);
      }
      .bar label {
        margin: 0;
      }
      output {
        font-variant-numeric: tabular-nums;
        min-width: 7.5rem;
        text-align: right;
      }
    `,
  ];

  @query("video") private video?: HTMLVideoElement;
  /** Where the browser cannot play the film, the server shows its pictures one by one. */
  @state() private isStills = false;
  @state() private still = "";
  private stillS = Number.NaN;
  private isFetching = false;

  override updated(): void {
    const { run, timeS, isPlaying } = this.view;
    if (!run || run.shows === "none") return;
    if (this.isStills || !run.is_video) {
      void this.showStill();
      return;
    }
    const { video } = this;
    if (!video) return;
    const wantedS = timeS - run.film_starts_s;
    if (isPlaying && video.paused) void video.play().catch(() => this.pause());
    if (!isPlaying && !video.paused) video.pause();
    // A film that plays tells where it is; one that stands is told, into the middle of the picture.
    if (!isPlaying && video.readyState > 0 && Math.abs(video.currentTime - wantedS) > 0.02) video.currentTime = wantedS + 1e-3;
  }

  private pause(): void {
    this.view.isPlaying = false;
    this.view.tellAll();
  }

  private follow(video: HTMLVideoElement): void {
    video.requestVideoFrameCallback((_, about) => {
      const { run, isPlaying } = this.view;
      if (run && isPlaying) this.view.goTo(about.mediaTime + run.film_starts_s);
      this.follow(video);
    });
  }

  private async showStill(): Promise<void> {
    const { run, timeS } = this.view;
    if (this.isFetching || !run || Math.abs(this.stillS - timeS) < 1e-6) return;
    this.isFetching = true;
    try {
      const { picture } = await this.view.picture(timeS);
      if (this.still) URL.revokeObjectURL(this.still);
      this.still = URL.createObjectURL(picture);
      this.stillS = timeS;
    } finally {
      this.isFetching = false;
    }
    if (this.view.isPlaying) {
      const next = this.view.next(1);
      if (next > run.last_s) this.pause();
      else this.view.goTo(next);
    } else {
      this.requestUpdate();
    }
  }

  override render() {
    const { run, frame } = this.view;
    if (!run) return nothing;
    const overlaid = run.shows !== "annotated" && run.width_px > 0;
    return html`
      ${run.why_not ? html`<p class="doubt">${this.say("filmNotThere", { why: run.why_not })}</p>` : nothing}
      <div class="frame">
        ${this.picture()}
        ${overlaid
          ? html`<svg viewBox="0 0 ${run.width_px} ${run.height_px}" role="img" aria-label=${this.say("film")}>${frame ? this.overlays(frame, run.width_px) : nothing}</svg>`
          : nothing}
      </div>
      ${frame && !frame.has_map ? html`<p class="doubt" role="status">⚠ ${this.say("noMap", { reason: frame.reason })}</p>` : nothing}
      ${this.bar()}
    `;
  }

  private picture() {
    const { run } = this.view;
    if (!run || run.shows === "none") {
      return html`<svg class="none" viewBox="0 0 16 9"></svg><img alt=${this.say("filmNone")} src=${blank(run?.width_px, run?.height_px)} />`;
    }
    if (this.isStills || !run.is_video) return html`<img alt=${this.say("film")} src=${this.still || blank(run.width_px, run.height_px)} />`;
    return html`<video
      src="/api/film"
      muted
      playsinline
      preload="auto"
      aria-label=${this.say("film")}
      @loadedmetadata=${(event: Event) => {
        this.follow(event.target as HTMLVideoElement);
        this.requestUpdate();
      }}
      @ended=${() => this.pause()}
      @error=${() => (this.isStills = true)}
    ></video>`;
  }

  private bar() {
    const { view } = this;
    const run = view.run!;
    return html`
      <div class="bar">
        <button class="main" id="play" @click=${() => this.toggle()}>${view.isPlaying ? `❚❚ ${this.say("pause")}` : `▶ ${this.say("play")}`}</button>
        <button aria-label=${this.say("before")} title=${this.say("before")} @click=${() => this.step(-1)}>◀</button>
        <button aria-label=${this.say("after")} title=${this.say("after")} @click=${() => this.step(1)}>▶</button>
        <input
          type="range"
          name="time"
          aria-label=${this.say("time")}
          aria-valuetext=${clock(view.timeS)}
          min=${run.first_s}
          max=${run.last_s}
          step="any"
          .value=${String(view.timeS)}
          @input=${(event: Event) => {
            view.isPlaying = false;
            view.goTo(Number((event.target as HTMLInputElement).value));
          }}
        />
        <output>${clock(view.timeS)} / ${clock(run.last_s)}</output>
        <label>
          ${this.say("speed")}
          <select name="speed" @change=${(event: Event) => this.video && (this.video.playbackRate = Number((event.target as HTMLSelectElement).value))}>
            ${SPEEDS.map((one) => html`<option value=${one} ?selected=${one === 1}>${one} ×</option>`)}
          </select>
        </label>
      </div>
    `;
  }

  private toggle(): void {
    const { view } = this;
    view.isPlaying = !view.isPlaying;
    if (view.isPlaying && view.timeS >= view.run!.last_s - 0.05) {
      if (this.video) this.video.currentTime = view.run!.first_s - view.run!.film_starts_s;
      view.goTo(view.run!.first_s);
    }
    view.tellAll();
  }

  private step(step: 1 | -1): void {
    this.view.isPlaying = false;
    this.view.goTo(this.view.next(step));
  }

  private overlays(frame: FrameAt, widthPx: number): SVGTemplateResult {
    const labels = labelsOver(widthPx, this.clientWidth);
    const thin = widthPx / 900;
    return svg`
      ${frame.tracks.map((one) => {
        const tone = TONES[one.severity ?? "none"];
        const [left, top, right, bottom] = one.box_px as [number, number, number, number];
        const ring = (one.circle_px as Pixel[]).map((at) => at.join(",")).join(" ");
        return svg`
          <polyline points=${ring} fill="none" stroke="#000" stroke-opacity="0.5" stroke-width=${4 * thin}></polyline>
          <polyline points=${ring} fill=${tone} fill-opacity="0.12" stroke=${tone} stroke-width=${2 * thin}></polyline>
          <rect x=${left} y=${top} width=${right - left} height=${bottom - top} fill="none" stroke=${tone} stroke-width=${1.5 * thin} stroke-dasharray=${one.is_seen ? "" : `${6 * thin} ${4 * thin}`}></rect>
        `;
      })}
      ${frame.pairs.map((one) => {
        if (!one.ends_px) return nothing;
        const [[x1, y1], [x2, y2]] = one.ends_px as [Pixel, Pixel];
        return svg`
          <line x1=${x1} y1=${y1} x2=${x2} y2=${y2} stroke="#000" stroke-opacity="0.5" stroke-width=${4 * thin}></line>
          <line x1=${x1} y1=${y1} x2=${x2} y2=${y2} stroke=${TONES[one.severity ?? "none"]} stroke-width=${(one.severity ? 2.5 : 1) * thin}></line>
        `;
      })}
      ${frame.pairs.map((one) => {
        if (!one.ends_px) return nothing;
        const [[x1, y1], [x2, y2]] = one.ends_px as [Pixel, Pixel];
        return labels.put([(x1 + x2) / 2, (y1 + y2) / 2], one.severity ? `${one.text} · ${this.say(one.severity)}` : one.text);
      })}
      ${frame.tracks.map((one) => {
        const [left, top, right] = one.box_px as [number, number, number, number];
        return labels.put([(left + right) / 2, top - labels.size / 3], `${this.say(one.kind as Word)} ${one.track_id}`);
      })}
    `;
  }
}

/** A picture of nothing, as large as the film's. */
function blank(width = 16, height = 9): string {
  return `data:image/svg+xml,${encodeURIComponent(`<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}"/>`)}`;
}
