import { createServer, request, type RequestListener, type Server } from "node:http";
import type { AddressInfo } from "node:net";

/** A server of another origin. */
export class Foreign {
  private constructor(
    private readonly server: Server,
    readonly url: string,
  ) {}

  static async listen(answer: RequestListener): Promise<Foreign> {
    const server = createServer(answer);
    await new Promise<void>((done) => server.listen(0, "127.0.0.1", done));
    const { port } = server.address() as AddressInfo;
    return new Foreign(server, `http://127.0.0.1:${port}`);
  }

  /** A proxy that shows a service under a prefix, which it takes away. */
  static async proxy(service: string, prefix: string): Promise<Foreign> {
    return await Foreign.listen((asked, answer) => {
      const path = asked.url ?? "";
      if (!path.startsWith(`${prefix}/`)) {
        answer.writeHead(404).end();
        return;
      }
      const { method, headers } = asked;
      const passed = request(service + path.slice(prefix.length), { method, headers }, (came) => {
        answer.writeHead(came.statusCode ?? 502, came.headers);
        came.pipe(answer);
      });
      passed.on("error", () => answer.destroy());
      answer.on("close", () => passed.destroy());
      asked.pipe(passed);
    });
  }

  async close(): Promise<void> {
    this.server.closeAllConnections();
    await new Promise((done) => this.server.close(done));
  }
}
