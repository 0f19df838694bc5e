import { defineConfig } from "vite";

export default defineConfig({
  base: "./",
  build: {
    outDir: "../src/standoff/service/page",
    emptyOutDir: true,
    // Nothing inline: the pages' policy runs files of their own address only.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    target: "es2022",
    rollupOptions: { input: ["setup.html", "review.html", "status.html"] },
  },
});
