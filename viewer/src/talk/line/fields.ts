// Written by `python -m ico3d.chat.generating`. Edit src/ico3d/chat/wire/protocol.py instead.

/** What a value of a message must be. */
export type Shape =
  | "integer"
  | "number"
  | "string"
  | "boolean"
  | { readonly maybe: Shape }
  | { readonly list: Shape }
  | { readonly record: Shape }
  | { readonly pair: readonly [Shape, Shape] }
  | { readonly words: readonly string[] }
  | { readonly fields: Fields };

/** What the values of a message must be, by their names. */
export type Fields = { readonly [field: string]: Shape };

/** What a message of the server must consist of, but for its arrays, by its type. */
export const SERVER_FIELDS: { readonly [type: string]: Fields } = {
  welcome: { version: "integer", session: "string", resumed: "boolean", services: { fields: { recognition: { fields: { name: "string", stand_in: "boolean" } }, language: { fields: { name: "string", stand_in: "boolean" } }, voice: { fields: { name: "string", stand_in: "boolean" } } } }, notices: { list: { fields: { code: "string", text: "string" } } }, dictation: { maybe: { fields: { language: "string", fallback: { maybe: "string" } } } }, offers: { list: { fields: { kind: { words: ["recognition", "language", "voice"] }, key: "string", name: "string", hindrance: "string" } } }, remembers: "boolean" },
  place: { session: "string", position: "integer", seconds: { maybe: "number" } },
  ack: { frames: "integer" },
  beat: {},
  state: { state: { words: ["idle", "listening", "thinking", "speaking"] } },
  transcript: { text: "string", final: "boolean" },
  answer: { utterance: "integer", first_sample: "integer", text: "string" },
  spoken: { utterance: "integer", first_sample: "integer", starts: { list: "integer" }, times: { list: "number" } },
  speech: { utterance: "integer", index: "integer", first_sample: "integer", first_expression: "integer" },
  timeline: { utterance: "integer", points: { list: { pair: ["number", "number"] } } },
  cues: { utterance: "integer", cues: { list: { fields: { number: "integer", name: "string", mirror: "boolean", begin: "number", stroke: "number", skip: "number" } } }, releases: { list: { fields: { number: "integer", time: "number" } } } },
  call: { name: "string", arguments: "string" },
  end: { utterance: "integer", samples: "integer" },
  stop: { utterance: "integer" },
  pause: { utterance: "integer" },
  resume: { utterance: "integer" },
  metrics: { name: "string", values: { record: "number" } },
  error: { message: "string", fatal: "boolean", again: "boolean", code: "string", values: { record: "number" } },
};
