/** The server's questions; their types are made from its own description of them. */

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

/** What the server refuses, in its own words. */
export class Refused extends Error {
  constructor(
    readonly status: number,
    message: string,
  ) {
    super(message);
  }
}

async function answered(path: string, method: string, question?: unknown): Promise<Response> {
  const request: RequestInit = { method };
  if (question !== undefined) {
    request.headers = { "Content-Type": "application/json" };
    request.body = JSON.stringify(question);
  }
  const answer = await fetch(path, request);
  if (!answer.ok) {
    const problem = (await answer.json().catch(() => ({}))) as Partial<Schemas["Problem"]>;
    const said = problem.expected ? `expected ${problem.expected}, found ${problem.found}. ${problem.fix}.` : answer.statusText;
    throw new Refused(answer.status, said);
  }
  return answer;
}

async function asked<Answer>(path: string, method: string, question?: unknown): Promise<Answer> {
  return (await (await answered(path, method, question)).json()) as Answer;
}

export const ask = {
  film: () => asked<FilmAnswer>("/api/film", "GET"),
  draft: () => asked<DraftAnswer>("/api/draft", "GET"),
  keep: (revision: number, draft: Draft) => asked<RevisionAnswer>("/api/draft", "PUT", { revision, draft }),
  corner: (time_s: number, at_px: Pixel) => asked<PointAnswer>("/api/corner", "POST", { time_s, at_px }),
  ground: (time_s: number, draft: Draft) => asked<GroundAnswer>("/api/ground", "POST", { time_s, draft }),
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
  picture: async (time_s: number): Promise<{ picture: Blob; time_s: number }> => {
    const answer = await answered(`/api/picture?time_s=${time_s}`, "GET");
    return { picture: await answer.blob(), time_s: Number(answer.headers.get("X-Time-S")) };
  },
  plan: async (time_s: number, draft: Draft) => (await answered("/api/plan", "POST", { time_s, draft })).blob(),
};
