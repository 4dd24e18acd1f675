import type { Locator } from "@playwright/test";

/** Drops a file on a part of the page. */
export async function dropOn(target: Locator, name: string, file: Buffer): Promise<void> {
  const dropped = await target.page().evaluateHandle(
    ({ name, bytes }) => {
      const transfer = new DataTransfer();
      const data = Uint8Array.from(atob(bytes), (char) => char.charCodeAt(0));
      transfer.items.add(new File([data], name));
      return transfer;
    },
    { name, bytes: file.toString("base64") },
  );
  await target.dispatchEvent("drop", { dataTransfer: dropped });
}
