// Files of a data set that a person edits, and those that it keeps of each clip.
#include "duet/datasets/annotations.h"
#include "duet/datasets/entry.h"
#include "duet/datasets/labelled/detector_confusion.h"
#include "duet/motion/synthesis/synthesis.h"
#include "tests/fuzz/reader.h"

namespace duet::fuzz {
namespace {

std::string annotations_sample(unsigned seed) {
  const Task task = kPaperTasks[seed % kPaperTasks.size()];
  return annotations_csv(
      {annotation_of(synthesize(task, {.seed = seed % 4})), {.clip = "other", .note = "a \"note\""}});
}

void read_annotation_bytes(std::string_view bytes) {
  const Annotations read = parse_annotations(bytes, "annotations.csv");
  std::vector<Annotation> list;
  for (const auto& [clip, annotation] : read) list.push_back(annotation);
  (void)annotations_csv(list);
}

std::string entry_sample(unsigned /*seed*/) {
  return entry_line({.clip = "clip",
                     .key = "00",
                     .status = ClipStatus::kKept,
                     .sources = {{"a.npz", "11"}},
                     .provenance = {{"phases", "proposed"}},
                     .task = "hug",
                     .reactor = "B",
                     .frames = 100,
                     .statistics = {.seconds = 2.0},
                     .metrics = {{"g1", {{"jpe", 0.1}}}}});
}

void read_entry_bytes(std::string_view bytes) { (void)entry_line(parse_entry(bytes, "entries.jsonl")); }

std::string labels_sample(unsigned seed) {
  return seed % 2 == 0 ? "clip,label\na-001,Shake hands\nb, hug\nc,\n"
                       : "\xef\xbb\xbf"
                         "clip,label\r\nd,kicking\r\n";
}

void read_label_bytes(std::string_view bytes) { (void)parse_clip_labels(bytes, "labels.csv"); }

}  // namespace

std::vector<Reader> dataset_readers() {
  return {{"dataset_annotations", annotations_sample, read_annotation_bytes},
          {"dataset_entry", entry_sample, read_entry_bytes},
          {"clip_labels", labels_sample, read_label_bytes}};
}

}  // namespace duet::fuzz
