/** How near anybody was, and how much ground was watched, over the whole run. */

import { css, html, nothing, unsafeCSS } from "lit";
import { customElement, query } from "lit/decorators.js";
import uPlot from "uplot";
import plotLook from "uplot/dist/uPlot.min.css?inline";
import { clock, ReviewPart } from "./review-part";

const HEIGHT_PX = 120;

@customElement("run-curves")
export class RunCurves extends ReviewPart {
  static override styles = [
    ...ReviewPart.styles,
    unsafeCSS(plotLook),
    css`
      .plot {
        height: ${HEIGHT_PX}px;
        margin-bottom: 0.6rem;
      }
    `,
  ];

  @query("#gap") private gapPlace?: HTMLElement;
  @query("#watched") private watchedPlace?: HTMLElement;
  private plots: uPlot[] = [];
  private drawnFor: unknown;
  private readonly sizes = new ResizeObserver(() => this.fit());
  private readonly dark = matchMedia("(prefers-color-scheme: dark)");
  private readonly again = () => {
    this.drawnFor = undefined;
    this.requestUpdate();
  };

  override connectedCallback(): void {
    super.connectedCallback();
    this.sizes.observe(this);
    this.dark.addEventListener("change", this.again);
  }

  override disconnectedCallback(): void {
    this.sizes.disconnect();
    this.dark.removeEventListener("change", this.again);
    super.disconnectedCallback();
  }

  override updated(): void {
    const { curves } = this.view;
    if (curves && this.drawnFor !== curves && this.gapPlace && this.watchedPlace) {
      this.drawnFor = curves;
      for (const plot of this.plots) plot.destroy();
      const watched = curves.watched.map((one) => (one === null ? null : 100 * one));
      this.plots = [
        this.plot(this.gapPlace, curves.time_s, curves.gap, "--accent"),
        this.plot(this.watchedPlace, curves.time_s, watched, "--good", [0, 100]),
      ];
    }
    for (const plot of this.plots) plot.redraw(false);
  }

  private fit(): void {
    for (const plot of this.plots) plot.setSize({ width: this.clientWidth, height: HEIGHT_PX });
  }

  private plot(place: HTMLElement, times: number[], values: (number | null)[], tone: string, range?: [number, number]): uPlot {
    const colour = (variable: string) => getComputedStyle(this).getPropertyValue(variable).trim();
    const axis = { stroke: colour("--ink"), grid: { stroke: colour("--line"), width: 1 }, ticks: { stroke: colour("--line") } };
    const options: uPlot.Options = {
      width: this.clientWidth || 600,
      height: HEIGHT_PX,
      cursor: { sync: { key: "time" }, drag: { x: true, y: false } },
      legend: { show: false },
      scales: { x: { time: false }, ...(range ? { y: { range } } : {}) },
      axes: [
        { ...axis, values: (_, ticks) => ticks.map(clock) },
        { ...axis, size: 46 },
      ],
      series: [{}, { stroke: colour(tone), width: 1.5, spanGaps: false, points: { show: times.length < 60 } }],
      hooks: { draw: [(plot) => this.mark(plot, colour("--bad"))] },
    };
    const plot = new uPlot(options, [times, values], place);
    plot.over.addEventListener("click", () => {
      const at = plot.cursor.left;
      if (at === undefined || at < 0) return;
      this.view.isPlaying = false;
      this.view.goTo(plot.posToVal(at, "x"));
    });
    return plot;
  }

  /** Draw where in the run one looks. */
  private mark(plot: uPlot, colour: string): void {
    const at = plot.valToPos(this.view.timeS, "x", true);
    const { left, top, width, height } = plot.bbox;
    if (at < left || at > left + width) return;
    plot.ctx.save();
    plot.ctx.strokeStyle = colour;
    plot.ctx.lineWidth = 2 * devicePixelRatio;
    plot.ctx.beginPath();
    plot.ctx.moveTo(at, top);
    plot.ctx.lineTo(at, top + height);
    plot.ctx.stroke();
    plot.ctx.restore();
  }

  override render() {
    const { curves, run } = this.view;
    if (!curves || !run) return nothing;
    const known = curves.gap.filter((one): one is number => one !== null);
    const least = known.length ? known.reduce((a, b) => Math.min(a, b)).toFixed(1) : "–";
    return html`
      <h2>${this.say("curves")}</h2>
      <p class="quiet" aria-hidden="true">${this.say("curveGap", { unit: run.unit })}</p>
      <div class="plot" id="gap" role="img" aria-label=${known.length ? this.say("curveSays", { least, unit: run.unit }) : this.say("curveNone")}></div>
      <p class="quiet" aria-hidden="true">${this.say("curveWatched")}</p>
      <div class="plot" id="watched" role="img" aria-label=${this.say("curveWatched")}></div>
    `;
  }
}
