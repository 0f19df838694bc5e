/** The picture with what is clicked in it and what the server says of it; corners, tape and zones are put here. */

import { css, html, nothing, svg, type SVGTemplateResult } from "lit";
import { customElement, query, state } from "lit/decorators.js";
import { lettersOver } from "../shared/look";
import { SetupPart } from "./setup-part";
import { PictureMarks } from "./picture-marks";
import { ask, type Pixel } from "./questions";

const CLICK_MOVES_PX = 4;
const MOST_ZOOM = 12;
const STEP_PX = 1;
const FINE_STEP_PX = 0.1;
const MAGNIFIES = 6;
const MAGNIFIER_PX = 132;
const ARROWS: Record<string, Pixel> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

type Grip = { kind: "corner" | "point"; index: number };

@customElement("picture-view")
export class PictureView extends SetupPart {
  static override styles = [
    ...SetupPart.styles,
    lettersOver,
    css`
      .bar {
        display: flex;
        flex-wrap: wrap;
        gap: 0.4rem 1rem;
        align-items: center;
        margin-bottom: 0.5rem;
      }
      .bar div {
        display: flex;
        flex-wrap: wrap;
        gap: 0.4rem;
        align-items: center;
      }
      .bar label {
        margin: 0;
      }
      .frame {
        position: relative;
        background: #000;
        border-radius: 8px;
        overflow: hidden;
      }
      svg.picture {
        display: block;
        width: 100%;
        touch-action: none;
        cursor: crosshair;
      }
      svg.magnifier {
        position: absolute;
        top: 8px;
        width: ${MAGNIFIER_PX}px;
        height: ${MAGNIFIER_PX}px;
        border: 2px solid #fff;
        border-radius: 8px;
        background: #000;
        pointer-events: none;
      }
      svg.magnifier.left {
        left: 8px;
      }
      svg.magnifier.right {
        right: 8px;
      }
      [tabindex]:focus-visible {
        outline: none;
        stroke: #ffd23f;
      }
      text {
        pointer-events: none;
      }
    `,
  ];

  @query("svg.picture") private svgElement?: SVGSVGElement;
  @state() private zoom = 1;
  @state() private middle: Pixel = [0, 0];
  @state() private showsErrors = true;
  @state() private showsWatched = false;
  @state() private showsCircles = true;
  @state() private under: Pixel | undefined;
  @state() private screenPx = 1;
  private held: { grip: Grip | undefined; from: Pixel; screen: Pixel; middle: Pixel; moved: boolean } | undefined;
  private readonly sizes = new ResizeObserver(() => this.measureScreen());

  override connectedCallback(): void {
    super.connectedCallback();
    this.sizes.observe(this);
  }

  override disconnectedCallback(): void {
    this.sizes.disconnect();
    super.disconnectedCallback();
  }

  private measureScreen(): void {
    const width = this.svgElement?.clientWidth ?? 0;
    if (width && this.site.film) this.screenPx = this.site.film.width_px / this.zoom / width;
  }

  /** The part of the picture that is shown: left, top, width, height in its pixels. */
  private get shown(): [number, number, number, number] {
    const { width_px, height_px } = this.site.film ?? { width_px: 1, height_px: 1 };
    const width = width_px / this.zoom;
    const height = height_px / this.zoom;
    const left = Math.min(Math.max(this.middle[0] - width / 2, -0.5), width_px - width - 0.5);
    const top = Math.min(Math.max(this.middle[1] - height / 2, -0.5), height_px - height - 0.5);
    return [left, top, width, height];
  }

  private zoomTo(zoom: number, about: Pixel): void {
    const [left, top, width, height] = this.shown;
    const next = Math.min(Math.max(zoom, 1), MOST_ZOOM);
    const share: Pixel = [(about[0] - left) / width, (about[1] - top) / height];
    const { width_px, height_px } = this.site.film!;
    this.zoom = next;
    this.middle = [about[0] + (0.5 - share[0]) * (width_px / next), about[1] + (0.5 - share[1]) * (height_px / next)];
    void this.updateComplete.then(() => this.measureScreen());
  }

  private at(event: PointerEvent | WheelEvent): Pixel {
    const matrix = this.svgElement!.getScreenCTM()!.inverse();
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix);
    return [point.x, point.y];
  }

  private positionOf(grip: Grip): Pixel | null {
    const draft = this.site.draft!;
    const found = grip.kind === "corner" ? draft.reference.corners_px[grip.index] : draft.survey.points[grip.index]?.at_px;
    return (found as Pixel | undefined) ?? null;
  }

  private put(grip: Grip, at: Pixel): void {
    this.site.change((draft) => {
      if (grip.kind === "corner") {
        draft.reference.corners_px[grip.index] = at;
        draft.reference.time_s = this.site.timeS;
      } else {
        const point = draft.survey.points[grip.index];
        if (point) point.at_px = at;
        draft.survey.time_s = this.site.timeS;
      }
    });
  }

  private async snap(grip: Grip, at: Pixel): Promise<void> {
    const near = await ask.corner(this.site.timeS, at).catch(() => undefined);
    // Unless it has been moved on meanwhile.
    const now = this.positionOf(grip);
    if (near?.snapped && now && Math.hypot(now[0] - at[0], now[1] - at[1]) < 0.5) this.put(grip, near.at_px as Pixel);
  }

  private press(event: PointerEvent, grip?: Grip): void {
    if (event.button !== 0) return;
    event.stopPropagation();
    this.svgElement!.setPointerCapture(event.pointerId);
    this.held = { grip, from: this.at(event), screen: [event.clientX, event.clientY], middle: this.middle, moved: false };
  }

  private move(event: PointerEvent): void {
    this.under = this.at(event);
    const held = this.held;
    if (!held) return;
    const away: Pixel = [event.clientX - held.screen[0], event.clientY - held.screen[1]];
    held.moved ||= Math.hypot(...away) > CLICK_MOVES_PX;
    if (!held.moved) return;
    if (held.grip) {
      this.site.isDragging = true;
      this.put(held.grip, this.under);
    } else this.middle = [held.middle[0] - away[0] * this.screenPx, held.middle[1] - away[1] * this.screenPx];
  }

  private release(event: PointerEvent): void {
    const held = this.held;
    this.held = undefined;
    if (!held) return;
    if (this.site.isDragging) {
      this.site.isDragging = false;
      void this.site.look();
    }
    const at = this.at(event);
    if (held.grip) {
      if (held.moved) void this.snap(held.grip, at);
    } else if (!held.moved) {
      this.place(at);
    }
  }

  private place(at: Pixel): void {
    const { site } = this;
    if (!site.draft) return;
    if (site.tool === "tape") void site.measure(at);
    else if (site.tool === "zone") this.zoneCorner(at);
    else this.newGrip(at);
  }

  private newGrip(at: Pixel): void {
    const draft = this.site.draft!;
    let grip: Grip | undefined;
    if (draft.ground === "reference" && draft.reference.corners_px.length < 4) {
      if (draft.reference.corners_px.length && Math.abs(draft.reference.time_s - this.site.timeS) > 1e-6) {
        this.site.change((one) => (one.reference.corners_px = []));
      }
      grip = { kind: "corner", index: this.site.draft!.reference.corners_px.length };
    } else if (draft.ground === "survey") {
      const index = draft.survey.points.findIndex((point) => !point.at_px);
      if (index >= 0) grip = { kind: "point", index };
    }
    if (!grip) return;
    this.put(grip, at);
    void this.snap(grip, at);
  }

  private zoneCorner(at: Pixel): void {
    const first = this.site.openZone[0];
    const closes = first && this.site.openZone.length >= 3 && Math.hypot(at[0] - first[0], at[1] - first[1]) < 12 * this.screenPx;
    if (closes) {
      void this.site.closeZone(this.say("zoneNew", { n: this.site.draft!.zones.length + 1 }));
    } else {
      this.site.openZone = [...this.site.openZone, at];
      this.site.tellAll();
    }
  }

  private key(event: KeyboardEvent, grip: Grip): void {
    const step = ARROWS[event.key];
    const at = this.positionOf(grip);
    if (!step || !at) return;
    event.preventDefault();
    const by = event.shiftKey ? FINE_STEP_PX : STEP_PX;
    this.put(grip, [at[0] + by * step[0], at[1] + by * step[1]]);
  }

  override render() {
    const { film, picture } = this.site;
    if (!film) return nothing;
    const [left, top, width, height] = this.shown;
    return html`
      ${this.bar()}
      <div class="frame">
        <svg
          class="picture"
          viewBox="${left} ${top} ${width} ${height}"
          role="group"
          aria-label=${this.say("picture")}
          @pointerdown=${(event: PointerEvent) => this.press(event)}
          @pointermove=${(event: PointerEvent) => this.move(event)}
          @pointerup=${(event: PointerEvent) => this.release(event)}
          @pointerleave=${() => (this.under = undefined)}
          @wheel=${(event: WheelEvent) => {
            event.preventDefault();
            this.zoomTo(this.zoom * Math.exp(-event.deltaY / 400), this.at(event));
          }}
        >
          <defs>
            <pattern id="hatch" width=${14 * this.screenPx} height=${14 * this.screenPx} patternUnits="userSpaceOnUse" patternTransform="rotate(45)">
              <rect width=${14 * this.screenPx} height=${14 * this.screenPx} fill="#000" fill-opacity="0.25"></rect>
              <line x1="0" y1="0" x2="0" y2=${14 * this.screenPx} stroke="#fff" stroke-opacity="0.6" stroke-width=${3 * this.screenPx}></line>
            </pattern>
          </defs>
          <image href=${picture} x="-0.5" y="-0.5" width=${film.width_px} height=${film.height_px}></image>
          ${this.overlays()}
        </svg>
        ${this.magnifier()}
      </div>
    `;
  }

  private bar() {
    const { site } = this;
    const tool = (name: typeof site.tool, word: "toolCorners" | "toolTape" | "toolZone") => html`
      <button
        aria-pressed=${site.tool === name}
        data-tool=${name}
        @click=${() => {
          site.tool = name;
          site.openZone = [];
          site.tellAll();
        }}
      >
        ${this.say(word)}
      </button>
    `;
    const layer = (word: "layerErrors" | "layerWatched" | "layerCircles", on: boolean, set: (on: boolean) => void) => html`
      <label><input type="checkbox" .checked=${on} @change=${(event: Event) => set((event.target as HTMLInputElement).checked)} />${this.say(word)}</label>
    `;
    return html`
      <div class="bar">
        <div role="group" aria-label=${this.say("tools")}>
          ${tool("corners", "toolCorners")}${tool("tape", "toolTape")}${tool("zone", "toolZone")}
          <button aria-label=${this.say("zoomIn")} @click=${() => this.zoomTo(this.zoom * 1.5, this.centre)}>+</button>
          <button aria-label=${this.say("zoomOut")} @click=${() => this.zoomTo(this.zoom / 1.5, this.centre)}>−</button>
        </div>
        <div role="group" aria-label=${this.say("layers")}>
          ${layer("layerErrors", this.showsErrors, (on) => (this.showsErrors = on))}
          ${layer("layerWatched", this.showsWatched, (on) => (this.showsWatched = on))}
          ${layer("layerCircles", this.showsCircles, (on) => (this.showsCircles = on))}
        </div>
      </div>
    `;
  }

  private get centre(): Pixel {
    const [left, top, width, height] = this.shown;
    return [left + width / 2, top + height / 2];
  }

  private get marks(): PictureMarks {
    return new PictureMarks(this.site.film!, this.screenPx, (word) => this.say(word));
  }

  private overlays(): SVGTemplateResult {
    const ground = this.site.ground;
    return svg`
      ${ground && this.showsWatched ? this.marks.unwatched(ground) : nothing}
      ${ground && this.showsErrors ? this.marks.contours(ground) : nothing}
      ${ground && this.showsCircles ? this.marks.circles(ground) : nothing}
      ${ground?.zones_px.map((ring) => this.marks.line(ring as Pixel[], "#ff8fd0", 2)) ?? nothing}
      ${ground?.solid_px.map((line) => this.marks.line(line as Pixel[], "#4df3ff", 2)) ?? nothing}
      ${this.marks.line(this.site.openZone, "#ff8fd0", 2)}
      ${this.site.openZone.map(([x, y]) => svg`<circle cx=${x} cy=${y} r=${4 * this.screenPx} fill="#ff8fd0"></circle>`)}
      ${this.tapeLine()}
      ${this.grips()}
    `;
  }

  private tapeLine(): SVGTemplateResult {
    const { tapeEnds, tape } = this.site;
    const [from, to] = tapeEnds;
    if (!from) return svg``;
    const end = to ?? from;
    return svg`
      ${this.marks.line([from, end], "#ffffff", 2.5)}
      ${[from, end].map(([x, y]) => svg`<circle cx=${x} cy=${y} r=${4 * this.screenPx} fill="#fff" stroke="#000" stroke-width=${this.screenPx}></circle>`)}
      ${tape ? this.marks.label([(from[0] + end[0]) / 2, (from[1] + end[1]) / 2 - 8 * this.screenPx], tape.text || this.say("tapeNone"), "middle") : nothing}
    `;
  }

  private grips(): SVGTemplateResult {
    const draft = this.site.draft;
    if (!draft) return svg``;
    const corners: [Grip, Pixel, string][] =
      draft.ground === "reference"
        ? draft.reference.corners_px.map((at, index) => [{ kind: "corner", index }, at as Pixel, this.say("corner", { n: index + 1 })])
        : [];
    const points: [Grip, Pixel, string][] =
      draft.ground === "survey"
        ? draft.survey.points.flatMap((point, index) => (point.at_px ? [[{ kind: "point", index }, point.at_px as Pixel, point.name] as [Grip, Pixel, string]] : []))
        : [];
    return svg`${[...corners, ...points].map(
      ([grip, [x, y], name]) => svg`
        <circle
          class="grip" cx=${x} cy=${y} r=${8 * this.screenPx} fill="#4df3ff" fill-opacity="0.25" stroke="#4df3ff" stroke-width=${2 * this.screenPx}
          tabindex="0" role="button" aria-label=${name} data-grip=${`${grip.kind}-${grip.index}`}
          @pointerdown=${(event: PointerEvent) => this.press(event, this.site.tool === "corners" ? grip : undefined)}
          @keydown=${(event: KeyboardEvent) => this.key(event, grip)}
        ></circle>
        <circle cx=${x} cy=${y} r=${1.2 * this.screenPx} fill="#4df3ff" pointer-events="none"></circle>
        ${this.marks.label([x + 10 * this.screenPx, y - 10 * this.screenPx], grip.kind === "corner" ? String(grip.index + 1) : name)}
      `,
    )}`;
  }

  private magnifier() {
    const { film, picture, tool } = this.site;
    if (!film || !this.under || tool === "zone") return nothing;
    const [x, y] = this.under;
    const width = (MAGNIFIER_PX * this.screenPx) / MAGNIFIES;
    const [left, , shownWidth] = this.shown;
    const side = x - left < shownWidth / 2 ? "right" : "left";
    const half = width / 2;
    return html`
      <svg class="magnifier ${side}" viewBox="${x - half} ${y - half} ${width} ${width}" aria-hidden="true">
        <image href=${picture} x="-0.5" y="-0.5" width=${film.width_px} height=${film.height_px}></image>
        <path d="M ${x - half} ${y} H ${x + half} M ${x} ${y - half} V ${y + half}" stroke="#ff3b30" stroke-width=${width / 100} fill="none"></path>
      </svg>
    `;
  }
}
