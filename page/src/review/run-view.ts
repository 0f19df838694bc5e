/** What the page knows of a run: where in it one looks, what is to be drawn there, and which hazards are shown. */

import { Knowledge } from "../shared/part";
import { ask, type CurvesAnswer, type FrameAt, type HazardAnswer, type RunAnswer, type Severity, type Verdict } from "./questions";

const SPAN_S = 4;
const SPANS_KEPT = 12;
/** Half a millisecond: times of pictures come rounded from the browser's clock of a film. */
const SAME_S = 5e-4;

export class RunView extends Knowledge {
  run?: RunAnswer;
  curves?: CurvesAnswer;
  timeS = 0;
  isPlaying = false;
  selected = "";
  severities = new Set<Severity>(["danger", "warning", "unknown"]);
  kind = "";
  isUnjudgedOnly = false;

  private spans = new Map<number, FrameAt[] | "asked">();

  async open(): Promise<void> {
    await this.trying(async () => {
      this.run = await ask.run();
      this.timeS = this.run.first_s;
    });
    this.listen();
    this.goTo(this.timeS);
    await this.trying(async () => {
      this.curves = await ask.curves();
    });
    this.tellAll();
  }

  /** Look at a time; the film follows, or has gone there first. */
  goTo(timeS: number): void {
    const { run } = this;
    if (!run) return;
    this.timeS = Math.min(Math.max(timeS, run.first_s), run.last_s);
    const span = Math.floor(this.timeS / SPAN_S);
    void this.fetchSpan(span);
    if (this.isPlaying) void this.fetchSpan(span + 1);
    this.tellAll();
  }

  /** What there is to draw at the time; undefined: it is still on its way, or the run has no such picture. */
  get frame(): FrameAt | undefined {
    const frames = this.spanAt(this.timeS);
    let found: FrameAt | undefined;
    for (const frame of frames) {
      if (frame.time_s > this.timeS + SAME_S) break;
      found = frame;
    }
    return found ?? this.spanAt(this.timeS - SPAN_S).at(-1);
  }

  /** The frames just before the time, the latest last. */
  before(lastsS: number): FrameAt[] {
    const all = [...this.spanAt(this.timeS - SPAN_S), ...this.spanAt(this.timeS)];
    const recent = all.filter((one) => one.time_s > this.timeS - lastsS && one.time_s <= this.timeS + SAME_S);
    // What was counted from elsewhere is no way that somebody went.
    return recent.slice(Math.max(0, recent.map((one) => one.is_moved).lastIndexOf(true)));
  }

  /** The time of the picture after this one, or before it. */
  next(step: 1 | -1): number {
    const times = [...this.spanAt(this.timeS - SPAN_S), ...this.spanAt(this.timeS), ...this.spanAt(this.timeS + SPAN_S)].map((one) => one.time_s);
    const found = step > 0 ? times.find((one) => one > this.timeS + SAME_S) : times.filter((one) => one < this.timeS - SAME_S).at(-1);
    return found ?? this.timeS + step / 25;
  }

  private spanAt(timeS: number): FrameAt[] {
    const span = this.spans.get(Math.floor(timeS / SPAN_S));
    return span === undefined || span === "asked" ? [] : span;
  }

  private async fetchSpan(span: number): Promise<void> {
    if (this.spans.has(span)) return;
    this.spans.set(span, "asked");
    await this.trying(async () => {
      this.spans.set(span, await ask.frames(Math.max(span * SPAN_S, 0), (span + 1) * SPAN_S - SAME_S));
    });
    if (this.spans.get(span) === "asked") this.spans.delete(span);
    for (const old of [...this.spans.keys()].slice(0, Math.max(0, this.spans.size - SPANS_KEPT))) this.spans.delete(old);
    this.tellAll();
  }

  picture = ask.picture;

  get kinds(): string[] {
    return [...new Set(this.run?.hazards.flatMap((one) => one.parties.map((party) => party.kind)))].sort();
  }

  get shown(): HazardAnswer[] {
    return (this.run?.hazards ?? []).filter(
      (one) =>
        this.severities.has(one.severity) &&
        (!this.kind || one.parties.some((party) => party.kind === this.kind)) &&
        (!this.isUnjudgedOnly || one.verdict === "open" || one.hazard_id === this.selected),
    );
  }

  get chosen(): HazardAnswer | undefined {
    return this.run?.hazards.find((one) => one.hazard_id === this.selected);
  }

  choose(hazard: HazardAnswer): void {
    this.isPlaying = false;
    this.selected = hazard.hazard_id;
    this.goTo(hazard.worst_s);
  }

  async judge(hazard: HazardAnswer, verdict: Verdict, comment: string): Promise<void> {
    await this.trying(async () => {
      const kept = await ask.review(hazard.hazard_id, verdict, comment);
      const hazards = this.run!.hazards.map((one) => (one.hazard_id === kept.hazard_id ? kept : one));
      this.run = { ...this.run!, hazards };
    });
    this.tellAll();
  }
}

export const view = new RunView();
