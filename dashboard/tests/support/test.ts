import { test as base } from "@playwright/test";
import { Service, type ServiceOptions } from "./service";

interface Fixtures {
  /** How the service of a test is started; set it with `test.use`. */
  serviceOptions: ServiceOptions;
  service: Service;
}

/** A test with a service of its own, to which the page's addresses are relative: `page.goto("#/live")`. */
export const test = base.extend<Fixtures>({
  serviceOptions: [{}, { option: true }],
  service: async ({ serviceOptions }, use) => {
    const service = await Service.start(serviceOptions);
    await use(service);
    await service.remove();
  },
  baseURL: async ({ service }, use) => {
    await use(`${service.url}/`);
  },
});

export { expect } from "@playwright/test";
