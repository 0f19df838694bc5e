/** How controls look, in every part of the page. */

import { css } from "lit";

/** Of a severity, over a picture. */
export const TONES = { danger: "#f5484a", warning: "#ffb224", unknown: "#a3abb5", none: "#ffffff" } as const;

/** Letters that stay readable over a picture. */
export const lettersOver = css`
  text {
    paint-order: stroke;
    stroke: #000;
    stroke-linejoin: round;
    fill: #fff;
    font-family: system-ui, sans-serif;
  }
`;

export const controls = css`
  :host {
    display: block;
  }
  h2 {
    font-size: 1rem;
    margin: 0 0 0.4rem;
  }
  summary {
    cursor: pointer;
  }
  summary h2 {
    display: inline;
  }
  fieldset {
    border: 0;
    margin: 0;
    padding: 0;
    min-width: 0;
  }
  p {
    margin: 0.3rem 0;
  }
  .quiet {
    color: var(--quiet);
    font-size: 0.9rem;
  }
  button,
  select,
  input,
  textarea {
    font: inherit;
    color: inherit;
    background: var(--panel);
    border: 1px solid var(--line);
    border-radius: 6px;
    padding: 0.3rem 0.6rem;
    min-height: 2rem;
    box-sizing: border-box;
  }
  input[type="radio"],
  input[type="checkbox"] {
    min-height: 0;
    margin: 0 0.4rem 0 0;
    accent-color: var(--accent);
  }
  button {
    cursor: pointer;
    max-width: 100%;
    overflow-wrap: anywhere;
  }
  button[aria-pressed="true"],
  button.main {
    background: var(--accent);
    border-color: var(--accent);
    color: var(--on-accent);
  }
  button:disabled {
    opacity: 0.55;
    cursor: default;
  }
  :focus-visible {
    outline: 3px solid var(--accent);
    outline-offset: 2px;
  }
  label {
    display: block;
    margin: 0.35rem 0;
  }
  label.row {
    display: flex;
    align-items: center;
    justify-content: space-between;
    gap: 0.8rem;
  }
  label.row input,
  label.row select {
    width: 9rem;
  }
  .wrong {
    color: var(--bad);
  }
  .good {
    color: var(--good);
    font-weight: 600;
  }
  .doubt {
    color: var(--doubt);
  }
  ul {
    margin: 0.3rem 0;
    padding-left: 1.2rem;
  }
  code {
    display: block;
    padding: 0.5rem;
    border: 1px solid var(--line);
    border-radius: 6px;
    overflow-wrap: anywhere;
  }
`;
