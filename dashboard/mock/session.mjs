// Sign-in with two made-up keys.

import { json, problem } from "./answers.mjs";

const KEYS = {
  rs_admin: { name: "anna", role: "admin" },
  rs_viewer: { name: "vera", role: "viewer" },
};
const COOKIE = "roomsight_mock";
const asked = Boolean(process.env.KEYS);

/** Who calls; undefined for a stranger. */
export function whoIs(request) {
  if (!asked) return {};
  const cookie = new RegExp(`${COOKIE}=(\\w+)`).exec(request.headers.cookie ?? "")?.[1];
  const key = request.headers.authorization?.replace("Bearer ", "") ?? cookie;
  return KEYS[key];
}

/** Calls of `v1/session`. */
export function sessionCall(request, url) {
  if (!asked) return json(200, {});
  if (request.method === "DELETE") {
    return { status: 204, headers: { "Set-Cookie": `${COOKIE}=; Max-Age=0; Path=/` } };
  }
  if (url.pathname.endsWith("/code")) {
    if (request.json().code !== "demo") return problem(401, "unauthorized", "The code is used up.");
    return signedIn("rs_admin");
  }
  const who = whoIs(request);
  if (!who) return problem(401, "unauthorized", "There is no such key.");
  if (request.method === "POST")
    return signedIn(request.headers.authorization.replace("Bearer ", ""));
  return json(200, { ...who, expires_in_s: 36_000 });
}

function signedIn(key) {
  const headers = { "Set-Cookie": `${COOKIE}=${key}; Path=/; HttpOnly; SameSite=Strict` };
  return json(200, { ...KEYS[key], expires_in_s: 43_200 }, headers);
}
