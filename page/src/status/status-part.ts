/** What every part of the page of a live site has. */

import { css } from "lit";
import { Part } from "../shared/part";
import type { Word } from "../shared/words";
import type { Quantiles, StreamAnswer } from "./questions";
import { view, type StatusView } from "./status-view";

/** How good things are; "bad" shouts. */
export type Tone = "good" | "doubt" | "bad";

/** By shape as well as by colour. */
export const MARKS: Record<Tone, string> = { good: "✓", doubt: "⚠", bad: "✗" };

export const statusLook = css`
  :host {
    --alarm: #b3140f;
    --on-alarm: #ffffff;
  }
  .alarm {
    background: var(--alarm);
    color: var(--on-alarm);
  }
  .pill {
    display: inline-block;
    border-radius: 99px;
    padding: 0 0.6rem;
    color: #14181d;
    font-weight: 600;
    white-space: nowrap;
  }
  .alarm .pill {
    box-shadow: 0 0 0 2px var(--on-alarm);
  }
  .unseen {
    position: absolute;
    width: 1px;
    height: 1px;
    overflow: hidden;
    clip-path: inset(50%);
    white-space: nowrap;
  }
  dl {
    display: grid;
    grid-template-columns: fit-content(50%) minmax(0, 1fr);
    gap: 0.1rem 0.8rem;
    margin: 0.4rem 0;
  }
  dt {
    color: var(--quiet);
  }
  dd {
    margin: 0;
    font-variant-numeric: tabular-nums;
    overflow-wrap: anywhere;
  }
  ul.plain,
  ol.plain {
    list-style: none;
    padding: 0;
  }
  summary {
    scroll-margin-top: 6rem;
  }
`;

export class StatusPart extends Part<StatusView> {
  static override styles = [...Part.styles, statusLook];

  protected readonly view = view;

  constructor() {
    super(view);
  }

  /** How numbers and times are written: as in the browser's own country where the language is its own. */
  protected get locale(): string {
    return navigator.languages.find((one) => one.slice(0, 2) === this.language) ?? this.language;
  }

  protected number(value: number, digits = 1): string {
    return value.toLocaleString(this.locale, { minimumFractionDigits: digits, maximumFractionDigits: digits }).replace("-", "−");
  }

  /** How long, as people say it. */
  protected lasting(ms: number, digits = 1): string {
    const seconds = Math.max(ms, 0) / 1e3;
    if (digits && seconds < 9.95) return `${this.number(seconds, digits)} s`;
    if (seconds < 120) return `${Math.floor(seconds)} s`;
    return seconds < 7200 ? `${Math.floor(seconds / 60)} min` : `${Math.floor(seconds / 3600)} h`;
  }

  protected percent(share: number): string {
    return `${Math.floor(100 * share + 1e-6)}\u00a0%`;
  }

  protected quantiles(found: Quantiles | null): string {
    if (!found) return this.say("notKnown");
    const { p50, p95, p99 } = found;
    return `p50 ${this.number(p50, 0)} · p95 ${this.number(p95, 0)} · p99 ${this.number(p99, 0)}\u00a0ms`;
  }

  /** Why a stream that is watched is still no full guard. */
  protected limits(stream: StreamAnswer): string[] {
    const found: Word[] = [];
    if (!stream.map) found.push("limitMap");
    else if (stream.watched_share !== null && stream.watched_share < 0.01) found.push("limitGround");
    if (stream.delay === "unknown") found.push("delay_unknown");
    return found.map((one) => this.say(one));
  }

  protected tone(stream: StreamAnswer): Tone {
    if (!this.view.isWatched(stream)) return "bad";
    return this.limits(stream).length ? "doubt" : "good";
  }
}
