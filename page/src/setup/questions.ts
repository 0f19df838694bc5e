/** The server's questions; their types are made from its own description of them. */

import { answered, asked, askedPicture } from "../shared/asking";
import type { components } from "./api-types";

type Schemas = components["schemas"];
export type Draft = Schemas["Draft-Output"];
export type DraftAnswer = Schemas["DraftAnswer"];
export type FilmAnswer = Schemas["FilmAnswer"];
export type GroundAnswer = Schemas["GroundAnswer"];
export type LengthAnswer = Schemas["LengthAnswer"];
export type PlacesAnswer = Schemas["PlacesAnswer"];
export type PointAnswer = Schemas["PointAnswer"];
export type RevisionAnswer = Schemas["RevisionAnswer"];
export type SaveAnswer = Schemas["SaveAnswer"];
export type TapeAnswer = Schemas["TapeAnswer"];
export type TrialAnswer = Schemas["TrialAnswer"];
export type UnitName = Draft["unit"];
export type Pixel = [number, number];

export const ask = {
  film: () => asked<FilmAnswer>("/api/film", "GET"),
  draft: () => asked<DraftAnswer>("/api/draft", "GET"),
  keep: (revision: number, draft: Draft) => asked<RevisionAnswer>("/api/draft", "PUT", { revision, draft }),
  corner: (time_s: number, at_px: Pixel) => asked<PointAnswer>("/api/corner", "POST", { time_s, at_px }),
  ground: (time_s: number, draft: Draft, is_dragging: boolean) => asked<GroundAnswer>("/api/ground", "POST", { time_s, draft, is_dragging }),
  length: (unit: UnitName, text: string) => asked<LengthAnswer>("/api/length", "POST", { unit, text }),
  lengthText: (unit: UnitName, length_m: number) => asked<LengthAnswer>("/api/length", "POST", { unit, length_m }),
  tape: (time_s: number, draft: Draft, from_px: Pixel, to_px: Pixel) =>
    asked<TapeAnswer>("/api/tape", "POST", { time_s, draft, from_px, to_px }),
  places: (time_s: number, draft: Draft, at_px: Pixel[]) =>
    asked<PlacesAnswer>("/api/places", "POST", { time_s, draft, at_px }),
  trial: () => asked<TrialAnswer>("/api/trial", "GET"),
  beginTrial: (time_s: number, draft: Draft) => asked<TrialAnswer>("/api/trial", "POST", { time_s, draft }),
  stopTrial: () => asked<TrialAnswer>("/api/trial", "DELETE"),
  save: (draft: Draft) => asked<SaveAnswer>("/api/save", "POST", { draft }),
  picture: askedPicture,
  plan: async (time_s: number, draft: Draft) => (await answered("/api/plan", "POST", { time_s, draft })).blob(),
};
