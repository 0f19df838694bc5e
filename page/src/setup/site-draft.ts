/** What the page knows: the draft, the picture that is looked at, and what the server says of both. */

import { Refused } from "../shared/asking";
import { Knowledge } from "../shared/part";
import { ask, type Draft, type FilmAnswer, type GroundAnswer, type Pixel, type TapeAnswer, type TrialAnswer } from "./questions";

const KEEP_AFTER_MS = 300;
const TRIAL_LOOKS_MS = 500;

export type Tool = "corners" | "tape" | "zone";

/** One state for all parts of the page; whoever changes it tells everybody. */
export class SiteDraft extends Knowledge {
  film?: FilmAnswer;
  draft?: Draft;
  siteFile = "";
  usualRadius: Record<string, number> = {};
  timeS = 0;
  picture = "";
  plan = "";
  ground?: GroundAnswer;
  isLooking = false;
  isDragging = false;
  tool: Tool = "corners";
  tapeEnds: Pixel[] = [];
  tape?: TapeAnswer;
  openZone: Pixel[] = [];
  trial: TrialAnswer = { state: "none", number: 0, frames: 0, frames_expected: null, message: "", summary: null };
  isStale = false;
  savedAs: { files: string[]; command: string } | undefined;

  private revision = 0;
  private keepLater?: ReturnType<typeof setTimeout>;
  private keeping: Promise<void> = Promise.resolve();
  private asksAgain = false;
  private isAsking = false;

  async open(): Promise<void> {
    this.film = await ask.film();
    await this.loadDraft();
    const told = this.draft?.ground === "survey" ? this.draft.survey : this.draft?.reference;
    await this.goTo(told?.time_s ?? this.film.first_s);
    this.listen();
  }

  async loadDraft(): Promise<void> {
    const answer = await ask.draft();
    this.draft = answer.draft;
    this.revision = answer.revision;
    this.siteFile = answer.site_file;
    this.usualRadius = answer.usual_radius_m;
    this.isStale = false;
    this.tellAll();
    void this.look();
  }

  /** Show the picture at a time, and look at it. */
  async goTo(timeS: number): Promise<void> {
    await this.trying(async () => {
      const { picture, time_s } = await ask.picture(timeS);
      if (this.picture) URL.revokeObjectURL(this.picture);
      this.picture = URL.createObjectURL(picture);
      this.timeS = time_s;
      this.tapeEnds = [];
      this.openZone = [];
      delete this.tape;
      delete this.ground;
    });
    this.tellAll();
    void this.look();
  }

  /** Change the draft; the server keeps it, and says what it means. */
  change(change: (draft: Draft) => void): void {
    if (!this.draft) return;
    const draft = structuredClone(this.draft);
    change(draft);
    this.draft = draft;
    this.savedAs = undefined;
    clearTimeout(this.keepLater);
    this.keepLater = setTimeout(() => this.keepSoon(), KEEP_AFTER_MS);
    this.tellAll();
    void this.look();
  }

  private keepSoon(): void {
    // One after another: each has to name the revision that the one before it made.
    this.keeping = this.keeping.then(() =>
      this.trying(async () => {
        if (!this.draft || this.isStale) return;
        this.revision = (await ask.keep(this.revision, this.draft)).revision;
      }),
    );
  }

  /** Ask what the draft says of the picture: one question at a time, and the newest after it. */
  async look(): Promise<void> {
    if (this.isAsking) {
      this.asksAgain = true;
      return;
    }
    this.isAsking = this.isLooking = true;
    this.tellAll();
    do {
      this.asksAgain = false;
      const { draft, timeS, isDragging } = this;
      if (!draft) break;
      await this.trying(async () => {
        const ground = await ask.ground(timeS, draft, isDragging);
        if (timeS === this.timeS) this.ground = ground;
        if (this.tapeEnds.length === 2) this.tape = await ask.tape(timeS, draft, this.tapeEnds[0]!, this.tapeEnds[1]!);
        this.isLooking = this.asksAgain;
        this.tellAll();
        if (!this.asksAgain && !isDragging) await this.showPlan(ground.plan ? await ask.plan(timeS, draft) : undefined);
      });
    } while (this.asksAgain);
    this.isAsking = this.isLooking = false;
    this.tellAll();
  }

  private async showPlan(picture: Blob | undefined): Promise<void> {
    if (this.plan) URL.revokeObjectURL(this.plan);
    this.plan = picture ? URL.createObjectURL(picture) : "";
  }

  async measure(at: Pixel): Promise<void> {
    this.tapeEnds = this.tapeEnds.length === 2 ? [at] : [...this.tapeEnds, at];
    delete this.tape;
    this.tellAll();
    if (this.tapeEnds.length === 2) await this.look();
  }

  /** Take what was drawn for a zone: its corners on the ground. */
  async closeZone(name: string): Promise<void> {
    const corners = this.openZone;
    this.openZone = [];
    if (!this.draft || corners.length < 3) return this.tellAll();
    await this.trying(async () => {
      const places = (await ask.places(this.timeS, this.draft!, corners)).at_m;
      const ring_m = places.filter((one): one is [number, number] => one !== null);
      if (ring_m.length >= 3) this.change((draft) => draft.zones.push({ name, kind: "no_go", ring_m }));
    });
    this.tellAll();
  }

  async runTrial(): Promise<void> {
    await this.trying(async () => {
      this.trial = await ask.beginTrial(this.timeS, this.draft!);
      while (this.trial.state === "running") {
        this.tellAll();
        await new Promise((done) => setTimeout(done, TRIAL_LOOKS_MS));
        this.trial = await ask.trial();
      }
    });
    this.tellAll();
  }

  async stopTrial(): Promise<void> {
    await this.trying(async () => {
      this.trial = await ask.stopTrial();
    });
    this.tellAll();
  }

  async save(): Promise<void> {
    clearTimeout(this.keepLater);
    await this.keeping;
    await this.trying(async () => {
      this.savedAs = await ask.save(this.draft!);
      this.revision = (await ask.draft()).revision;
    });
    this.tellAll();
  }

  protected override refused(error: unknown): void {
    if (error instanceof Refused && error.status === 409) this.isStale = true;
    else super.refused(error);
  }
}

export const site = new SiteDraft();
