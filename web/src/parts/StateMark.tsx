/** The state of a slot as a shape and a colour: the shape alone says it, too. */

type Shape =
  | "full"
  | "dot"
  | "half"
  | "quarter"
  | "most"
  | "hollow"
  | "dashed"
  | "triangle"
  | "diamond"
  | "cross"
  | "twins"
  | "unequal";

const shapes: Record<string, { shape: Shape; tone: string; about: string }> = {
  operational: { shape: "full", tone: "good", about: "Its device runs." },
  binding: { shape: "quarter", tone: "busy", about: "Its device gets its node-ID." },
  present: { shape: "half", tone: "busy", about: "Its device answers, and does not run yet." },
  configuring: { shape: "most", tone: "busy", about: "Its settings are written." },
  unknown: { shape: "dot", tone: "absent", about: "Berth does not know its device's state; the reason says why." },
  absent: { shape: "hollow", tone: "absent", about: "Its device does not answer." },
  empty: { shape: "dashed", tone: "absent", about: "It has no device." },
  question: { shape: "triangle", tone: "question", about: "Berth cannot decide which device belongs here: answer." },
  "power cycle needed": { shape: "diamond", tone: "question", about: "Switch its device off and on again." },
  failed: { shape: "cross", tone: "bad", about: "Its device could not be started; the reason says why." },
  duplicate: { shape: "twins", tone: "bad", about: "Two devices have its node-ID." },
  "wrong type": { shape: "unequal", tone: "bad", about: "A device of another type sits here." },
};

/** All, and what each means. */
export const states = Object.entries(shapes).map(([state, { about }]) => ({ state, about }));

export function toneOf(state: string): string {
  return shapes[state]?.tone ?? "absent";
}

function paths(shape: Shape) {
  switch (shape) {
    case "full":
      return <circle className="fill" cx="7" cy="7" r="5" />;
    case "dot":
      return <circle className="fill" cx="7" cy="7" r="1.8" />;
    case "quarter":
      return <path className="fill" d="M7 7V2a5 5 0 0 1 5 5z" />;
    case "half":
      return <path className="fill" d="M7 2a5 5 0 0 1 0 10z" />;
    case "most":
      return <path className="fill" d="M7 7V2a5 5 0 1 1-5 5z" />;
    case "dashed":
      return <circle className="line dashes" cx="7" cy="7" r="5" />;
    case "triangle":
      return (
        <>
          <path className="fill" d="M7 1l6.5 12H.5z" />
          <path className="hole" d="M7 5v4M7 10.5v1" />
        </>
      );
    case "diamond":
      return (
        <>
          <path className="fill" d="M7 .5L13.5 7 7 13.5.5 7z" />
          <path className="hole" d="M7 3.5V7M4.8 5.5a3 3 0 1 0 4.4 0" />
        </>
      );
    case "cross":
      return (
        <>
          <rect className="fill" x="1" y="1" width="12" height="12" rx="1" />
          <path className="hole" d="M4 4l6 6M10 4l-6 6" />
        </>
      );
    case "twins":
      return (
        <>
          <rect className="fill" x="1" y="1" width="7" height="7" />
          <rect className="fill" x="6.5" y="6.5" width="6.5" height="6.5" />
        </>
      );
    case "unequal":
      return (
        <>
          <rect className="fill" x="1" y="1" width="12" height="12" rx="1" />
          <path className="hole" d="M3.5 5.5h7M3.5 8.5h7M9 3l-4 8" />
        </>
      );
    case "hollow":
      return null;
  }
}

const ringed = new Set<Shape>(["dot", "quarter", "half", "most", "hollow"]);

/** Inside of another SVG. */
export function StateShape({ state }: { state: string }) {
  const { shape, tone } = shapes[state] ?? { shape: "hollow" as const, tone: "absent" };
  return (
    <g className={`mark tone-${tone}`}>
      {ringed.has(shape) && <circle className="line" cx="7" cy="7" r="5" />}
      {paths(shape)}
    </g>
  );
}

export function StateMark({ state }: { state: string }) {
  return (
    <svg className="state-mark" viewBox="0 0 14 14" width="14" height="14" aria-hidden="true">
      <StateShape state={state} />
    </svg>
  );
}

export function StateWord({ state }: { state: string }) {
  return (
    <span className={`state-word tone-${toneOf(state)}`}>
      <StateMark state={state} /> {state}
    </span>
  );
}
