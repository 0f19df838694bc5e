/** What stands around every page: its head, its alerts, and the choice of the language. */

import { css, html } from "lit";
import { LANGUAGES, say, type Language } from "./words";

export const frameLook = css`
  header {
    display: flex;
    flex-wrap: wrap;
    gap: 0.4rem 1.2rem;
    align-items: center;
    padding: 0.6rem 1rem;
    background: var(--panel);
    border-bottom: 1px solid var(--line);
  }
  h1 {
    font-size: 1.1rem;
    margin: 0 auto 0 0;
  }
  header label {
    margin: 0;
  }
  main {
    display: grid;
    grid-template-columns: minmax(0, 1fr) 24rem;
    gap: 1rem;
    padding: 1rem;
    max-width: 112rem;
    margin: 0 auto;
  }
  section {
    background: var(--panel);
    border: 1px solid var(--line);
    border-radius: 10px;
    padding: 0.8rem;
    margin-bottom: 0.8rem;
  }
  .notice {
    margin: 0;
    padding: 0.5rem 1rem;
    background: var(--panel);
    border-bottom: 2px solid var(--bad);
  }
  .below {
    display: grid;
    grid-template-columns: minmax(0, 1fr) minmax(0, 1fr);
    gap: 0.8rem;
  }
  @media (max-width: 60rem) {
    main,
    .below {
      grid-template-columns: minmax(0, 1fr);
    }
  }
`;

export function languageChoice(language: Language, choose: (language: Language) => void) {
  return html`
    <label>
      ${say(language, "language")}
      <select
        name="language"
        @change=${(event: Event) => {
          const chosen = (event.target as HTMLSelectElement).value as Language;
          localStorage.setItem("standoff-language", chosen);
          document.documentElement.lang = chosen;
          choose(chosen);
        }}
      >
        ${Object.entries(LANGUAGES).map(([name, one]) => html`<option value=${name} ?selected=${name === language}>${one.name}</option>`)}
      </select>
    </label>
  `;
}
