/** The service itself, for whoever looks after it. */

import { css, html, nothing } from "lit";
import { customElement } from "lit/decorators.js";
import type { Word } from "../shared/words";
import { MARKS, StatusPart } from "./status-part";

@customElement("service-facts")
export class ServiceFacts extends StatusPart {
  static override styles = [
    ...StatusPart.styles,
    css`
      h3 {
        font-size: 0.95rem;
        margin: 0.8rem 0 0;
      }
    `,
  ];

  override render() {
    const { status, isCurrent } = this.view;
    if (!status) return nothing;
    return html`<details>
      <summary><h2>${this.say("service")}</h2></summary>
      ${isCurrent ? nothing : html`<p class="wrong">${this.say("noAnswerSaid")}</p>`}
      <dl>
        <dt>${this.say("broker")}</dt>
        <dd>${status.broker}: ${this.whether(status.broker_connected, "connected", "connectedNot")}</dd>
        <dt>${this.say("toWrist")}</dt>
        <dd>${this.quantiles(status.to_wrist_ms)}</dd>
        <dt>${this.say("sentToShown")}</dt>
        <dd>${this.quantiles(status.sent_to_shown_ms)}</dd>
      </dl>
      <h3>${this.say("detecting")}</h3>
      <dl>${status.streams.map((one) => html`<dt>${one.name}</dt><dd>${this.quantiles(one.detect_ms)}</dd>`)}</dl>
      <h3>${this.say("letters")}</h3>
      <dl>${Object.entries(status.letters).map(([name, count]) => html`<dt>${this.say(`letter_${name}` as Word)}</dt><dd>${this.number(count, 0)}</dd>`)}</dl>
      <h3>${this.say("processes")}</h3>
      <dl>
        ${status.processes.map(
          (one) => html`<dt>${one.name}</dt>
            <dd>${this.whether(one.is_answering, "answers", "answersNot")}, ${this.say("starts", { n: one.starts })}</dd>`,
        )}
      </dl>
    </details>`;
  }

  private whether(isSo: boolean, yes: Word, no: Word) {
    return isSo ? html`<span>${this.say(yes)}</span>` : html`<span class="wrong">${MARKS.bad} ${this.say(no)}</span>`;
  }
}
