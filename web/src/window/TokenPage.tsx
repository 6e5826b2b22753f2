import { useState, type FormEvent } from "react";
import { keepToken, tokenIn } from "../socket/token";
import { useStudio } from "./context";

export function TokenPage({ refused }: { refused: boolean }) {
  const { socket } = useStudio();
  const [text, setText] = useState("");
  const token = tokenIn(text);
  const submit = (event: FormEvent) => {
    event.preventDefault();
    if (!token) return;
    keepToken(token, sessionStorage);
    socket.start(token);
  };
  return (
    <main className="token-page">
      <h1>Berth Studio</h1>
      <p>
        {refused
          ? "The server refuses this page's token. The server was restarted, or the address is incomplete."
          : "This page needs the token of the running Berth."}{" "}
        Paste the address that <code>berth</code> printed.
      </p>
      <form onSubmit={submit}>
        <label htmlFor="token">Address or token</label>
        <input
          id="token"
          autoFocus
          autoComplete="off"
          value={text}
          placeholder="http://127.0.0.1:8302/#token=…"
          onChange={(event) => setText(event.target.value)}
        />
        <button type="submit" className="primary" disabled={!token}>
          Open
        </button>
      </form>
    </main>
  );
}
