/** What every part of the page of a run has. */

import { Part } from "../shared/part";
import type { Word } from "../shared/words";
import type { HazardAnswer } from "./questions";
import { view, type RunView } from "./run-view";

export class ReviewPart extends Part<RunView> {
  protected readonly view = view;

  constructor() {
    super(view);
  }

  /** Whom a hazard is about, in words. */
  protected who(hazard: HazardAnswer): string {
    const parties = hazard.parties.map((one) => `${this.say(one.kind as Word)} ${one.track_id}`);
    if (hazard.rule === "proximity" && parties.length === 1) parties.push(this.say("perhapsSomebody"));
    const zone = hazard.zone ? this.say("inZone", { name: hazard.zone }) : "";
    return [parties.join(" · "), zone].filter(Boolean).join(", ") || this.say("wholeStream");
  }
}

/** A time as people read it: minutes and seconds, hours where there are any. */
export function clock(timeS: number): string {
  const tenths = Math.round(timeS * 10);
  const [hours, minutes, seconds] = [Math.floor(tenths / 36000), Math.floor(tenths / 600) % 60, (tenths % 600) / 10];
  const rest = `${String(minutes).padStart(hours ? 2 : 1, "0")}:${seconds.toFixed(1).padStart(4, "0")}`;
  return hours ? `${hours}:${rest}` : rest;
}
