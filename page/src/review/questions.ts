/** The server's questions about a run; their types are made from its own description of them. */

import { asked, askedPicture } from "../shared/asking";
import type { components } from "./api-types";

type Schemas = components["schemas"];
export type CurvesAnswer = Schemas["CurvesAnswer"];
export type FrameAt = Schemas["FrameAt"];
export type HazardAnswer = Schemas["HazardAnswer"];
export type RunAnswer = Schemas["RunAnswer"];
export type Severity = HazardAnswer["severity"];
export type Verdict = HazardAnswer["verdict"];

export const ask = {
  run: () => asked<RunAnswer>("/api/run", "GET"),
  curves: () => asked<CurvesAnswer>("/api/curves", "GET"),
  frames: async (from_s: number, to_s: number) =>
    (await asked<Schemas["FramesAnswer"]>(`/api/frames?from_s=${from_s}&to_s=${to_s}`, "GET")).frames,
  picture: askedPicture,
  review: (hazard_id: string, verdict: Verdict, comment: string) =>
    asked<HazardAnswer>("/api/review", "PUT", { hazard_id, verdict, comment }),
};
