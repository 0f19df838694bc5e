/** What every part of the set-up page has. */

import { Part } from "../shared/part";
import { site, type SiteDraft } from "./site-draft";

export class SetupPart extends Part<SiteDraft> {
  protected readonly site = site;

  constructor() {
    super(site);
  }
}
