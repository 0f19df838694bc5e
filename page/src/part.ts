/** What every part of the page has: the state that it watches, and the language that it speaks. */

import { LitElement } from "lit";
import { property } from "lit/decorators.js";
import { controls } from "./look";
import { site, Watching } from "./site-draft";
import { say, usualLanguage, type Language, type Word } from "./words";

export class Part extends LitElement {
  static override styles = [controls];

  @property() language: Language = usualLanguage();
  protected readonly site = site;

  constructor() {
    super();
    new Watching(this, () => site);
  }

  protected say(word: Word, parts: Record<string, string | number> = {}): string {
    return say(this.language, word, parts);
  }
}
