/** The server's questions about a live site; their types are made from its own description of them. */

import { answered, asked } from "../shared/asking";
import type { components } from "./api-types";

type Schemas = components["schemas"];
export type OpenHazardAnswer = Schemas["OpenHazardAnswer"];
export type Quantiles = Schemas["Quantiles"];
export type ShelfAnswer = Schemas["ShelfAnswer"];
export type StatusAnswer = Schemas["StatusAnswer"];
export type StreamAnswer = Schemas["StreamAnswer"];
export type Severity = OpenHazardAnswer["severity"];

/** What comes later than this is not worth waiting for. */
const WITHIN_MS = 3000;

export const ask = {
  status: () => asked<StatusAnswer>("/api/status", "GET", undefined, WITHIN_MS),
  /** The newest picture of a stream, and how old it was when the server sent it. */
  picture: async (stream: string): Promise<{ picture: Blob; age_ms: number }> => {
    const answer = await answered(`/api/streams/${encodeURIComponent(stream)}/picture`, "GET", undefined, WITHIN_MS);
    return { picture: await answer.blob(), age_ms: Number(answer.headers.get("X-Age-Ms") ?? Number.NaN) };
  },
};
