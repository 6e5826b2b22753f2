/** The token comes in the fragment of the printed address, leaves it at once and stays in this tab only. */

const KEY = "berth-token";

export interface Place {
  hash: string;
  pathname: string;
  search: string;
}

export interface Storage {
  getItem(key: string): string | null;
  setItem(key: string, value: string): void;
  removeItem(key: string): void;
}

/** The token, or null; `replace` gets the address without it. */
export function takeToken(place: Place, storage: Storage, replace: (address: string) => void): string | null {
  const values = new URLSearchParams(place.hash.replace(/^#/, ""));
  const token = values.get("token");
  if (token === null) return storage.getItem(KEY);
  values.delete("token");
  const rest = values.toString();
  replace(place.pathname + place.search + (rest ? `#${rest}` : ""));
  if (isToken(token)) storage.setItem(KEY, token);
  return isToken(token) ? token : storage.getItem(KEY);
}

export function keepToken(token: string, storage: Storage): void {
  storage.setItem(KEY, token);
}

export function dropToken(storage: Storage): void {
  storage.removeItem(KEY);
}

/** It becomes part of a subprotocol's name, which HTTP restricts to these characters. */
export function isToken(text: string): boolean {
  return /^[\w!#$%&'*+.^`|~-]{1,256}$/.test(text);
}

/** What a person pasted: the printed address, or the token alone. Null: neither. */
export function tokenIn(pasted: string): string | null {
  const text = pasted.trim();
  const match = /[#&]token=([^&\s]+)/.exec(text);
  const token = match?.[1] ?? text;
  return isToken(token) ? token : null;
}
