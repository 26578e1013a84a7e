/** The package `ico3d`: it makes `<ico3d-avatar>` known to the browser. */
import { defineAvatar } from './element.ts';

export * from './api.ts';

defineAvatar();
