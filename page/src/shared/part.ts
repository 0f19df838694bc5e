/** What every part of a page has: how it looks, and the language that it speaks. */

import { LitElement, type ReactiveController } from "lit";
import { property } from "lit/decorators.js";
import { controls } from "./look";
import { say, usualLanguage, type Language, type Word } from "./words";

/** A part of a page; it is drawn again whenever what the page knows has changed. */
export abstract class Part<Known extends EventTarget> extends LitElement {
  static override styles = [controls];

  @property() language: Language = usualLanguage();

  constructor(known: Known) {
    super();
    this.addController(new Watching(known, () => this.requestUpdate()));
  }

  protected say(word: Word, parts: Record<string, string | number> = {}): string {
    return say(this.language, word, parts);
  }
}

class Watching implements ReactiveController {
  constructor(
    private readonly known: EventTarget,
    private readonly again: () => void,
  ) {}

  hostConnected(): void {
    this.known.addEventListener("change", this.again);
  }

  hostDisconnected(): void {
    this.known.removeEventListener("change", this.again);
  }
}

/** What a page knows; whoever changes it tells everybody. */
export class Knowledge extends EventTarget {
  problem = "";
  isOffline = false;

  tellAll(): void {
    this.dispatchEvent(new Event("change"));
  }

  /** Do something that the server may refuse; its words are shown. */
  protected async trying(work: () => Promise<void>): Promise<void> {
    try {
      this.problem = "";
      await work();
    } catch (error) {
      this.refused(error);
      this.tellAll();
    }
  }

  protected refused(error: unknown): void {
    this.problem = error instanceof Error ? error.message : String(error);
  }

  /** The server hears that the page is open, and the page that the server is. */
  protected listen(): void {
    const events = new EventSource("/api/events");
    for (const [name, isOffline] of [["open", false], ["error", true]] as const) {
      events.addEventListener(name, () => {
        this.isOffline = isOffline;
        this.tellAll();
      });
    }
  }
}
