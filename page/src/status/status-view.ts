/** What the page knows of a live site, and for how long it has not heard of it. */

import { Refused } from "../shared/asking";
import { Knowledge } from "../shared/part";
import { ask, type OpenHazardAnswer, type Severity, type StatusAnswer, type StreamAnswer } from "./questions";

const TICK_MS = 250;
const ASK_EVERY_MS = 1000;
/** What is older is nothing that is now. */
const CURRENT_MS = 3000;
const FORBIDDEN = 403;

/** The gravest first. */
export const SEVERITIES: Severity[] = ["danger", "warning", "unknown"];

export interface OpenHazard extends OpenHazardAnswer {
  stream: StreamAnswer;
}

/** A moment, by both clocks of the browser: one of them stands while the machine sleeps, the other may be set. */
export class Moment {
  private readonly steadyMs = performance.now();
  private readonly wallMs = Date.now();

  /** How long ago it was; rather too long than too short. */
  get agoMs(): number {
    return Math.max(performance.now() - this.steadyMs, Date.now() - this.wallMs);
  }
}

export class StatusView extends Knowledge {
  status?: StatusAnswer;
  isShutOut = false;

  /** An answer is as old as its question. */
  private heard = new Moment();
  private asked?: Moment;
  private isAsking = false;

  open(): void {
    this.heard = new Moment();
    setInterval(() => this.tick(), TICK_MS);
    document.addEventListener("visibilitychange", () => this.tick());
    this.tick();
  }

  /** For how long nothing was heard. */
  get silentMs(): number {
    return this.heard.agoMs;
  }

  /** Whether what is known is of now; false before the first answer. */
  get isCurrent(): boolean {
    return this.status !== undefined && !this.isSilent;
  }

  /** Whether the service does not answer. */
  get isSilent(): boolean {
    return this.isOffline || this.silentMs > CURRENT_MS;
  }

  /** Whether the silence of a stream means anything. */
  isWatched(stream: StreamAnswer): boolean {
    return this.isCurrent && stream.is_watched && stream.state === "live";
  }

  get unwatched(): number {
    return this.status?.streams.filter((one) => !this.isWatched(one)).length ?? 0;
  }

  /** All that is open, the gravest first, then the nearest. */
  get hazards(): OpenHazard[] {
    const all = this.status?.streams.flatMap((stream) => stream.hazards.map((one) => ({ ...one, stream }))) ?? [];
    const grave = (one: OpenHazard) => SEVERITIES.indexOf(one.severity);
    const gap = (one: OpenHazard) => one.gap_m ?? Number.POSITIVE_INFINITY;
    return all.sort((a, b) => grave(a) - grave(b) || (gap(a) < gap(b) ? -1 : gap(a) > gap(b) ? 1 : 0));
  }

  private tick(): void {
    if (!this.isAsking && (this.asked?.agoMs ?? Number.POSITIVE_INFINITY) >= ASK_EVERY_MS) void this.hear();
    this.tellAll();
  }

  private async hear(): Promise<void> {
    this.isAsking = true;
    const asked = (this.asked = new Moment());
    try {
      this.status = await ask.status();
      this.heard = asked;
      this.isOffline = this.isShutOut = false;
    } catch (error) {
      this.isOffline = true;
      this.isShutOut = error instanceof Refused && error.status === FORBIDDEN;
    } finally {
      this.isAsking = false;
    }
    this.tellAll();
  }
}

export const view = new StatusView();
