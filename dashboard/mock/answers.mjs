// Answers in the service's form.

export function json(status, value, headers = {}) {
  return { status, type: "application/json", body: JSON.stringify(value), headers };
}

export function problem(status, kind, detail) {
  const body = { type: `/problems/${kind}`, title: kind, status, detail, request_id: "mock-1" };
  return { status, type: "application/problem+json", body: JSON.stringify(body) };
}
