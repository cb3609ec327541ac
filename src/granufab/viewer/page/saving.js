// Files that the browser saves: pictures of the panels, named after run, panel and frame.

const plain = (text) => text.replace(/\.h5$/, "").split("/").filter((part) => part && part !== "run").slice(-2).join("-").replace(/[^\w.=+-]+/g, "_");

export const fileName = (run, panel, frame, type) => `${plain(run) || "run"}-${panel}-frame${frame}.${type}`;

export function save(blob, name) {
  const link = document.createElement("a");
  link.download = name;
  link.href = URL.createObjectURL(blob);
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
