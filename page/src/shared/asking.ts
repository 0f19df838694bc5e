/** How a page asks the server. */

/** What the server refuses, in its own words. */
export class Refused extends Error {
  constructor(
    readonly status: number,
    message: string,
  ) {
    super(message);
  }
}

interface Problem {
  expected: string;
  found: string;
  fix: string;
}

export async function answered(path: string, method: string, question?: unknown, withinMs?: number): Promise<Response> {
  const request: RequestInit = { method };
  if (withinMs !== undefined) request.signal = AbortSignal.timeout(withinMs);
  if (question !== undefined) {
    request.headers = { "Content-Type": "application/json" };
    request.body = JSON.stringify(question);
  }
  const answer = await fetch(path, request);
  if (!answer.ok) {
    const problem = (await answer.json().catch(() => ({}))) as Partial<Problem>;
    const said = problem.expected ? `expected ${problem.expected}, found ${problem.found}. ${problem.fix}.` : answer.statusText;
    throw new Refused(answer.status, said);
  }
  return answer;
}

export async function asked<Answer>(path: string, method: string, question?: unknown, withinMs?: number): Promise<Answer> {
  return (await (await answered(path, method, question, withinMs)).json()) as Answer;
}

/** The picture at a time, and when it really is. */
export async function askedPicture(timeS: number): Promise<{ picture: Blob; time_s: number }> {
  const answer = await answered(`/api/picture?time_s=${timeS}`, "GET");
  return { picture: await answer.blob(), time_s: Number(answer.headers.get("X-Time-S")) };
}
