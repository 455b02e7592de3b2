#include "duet/cluster/shard_plan.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "duet/backends/engine_module.h"
#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/rows/episode_row.h"
#include "duet/rows/folder/run_files.h"
#include "duet/rows/folder/run_info.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

using nlohmann::json;
using Kind = ShardPlan::Kind;

constexpr const char* kPlanSchema = "duet.plan/1";
constexpr std::int64_t kMostShards = 1'000'000;

// Blocks of one engine, which follow one another.
struct EngineBlocks {
  const PlanBlock* begin;
  const PlanBlock* end;
  double cost = 0.0;
  std::int64_t shards = 1;
  [[nodiscard]] std::int64_t size() const { return end - begin; }
};

std::vector<EngineBlocks> by_engine(const std::vector<PlanBlock>& blocks) {
  std::vector<EngineBlocks> engines;
  for (const PlanBlock& block : blocks) {
    if (engines.empty() || engines.back().begin->engine != block.engine) engines.push_back({&block, &block});
    engines.back().end = &block + 1;
    engines.back().cost += block.cost;
  }
  return engines;
}

// Shares out `count` shards: one at least to each engine, the next one always to the engine with the costliest shards.
void share_out(std::vector<EngineBlocks>& engines, std::int64_t count) {
  const auto shard_cost = [](const EngineBlocks& engine) {
    return engine.shards < engine.size() ? engine.cost / static_cast<double>(engine.shards) : -1.0;
  };
  for (auto left = count - static_cast<std::int64_t>(engines.size()); left > 0; --left)
    ++std::ranges::max_element(engines, {}, shard_cost)->shards;
}

void cut_engine(const EngineBlocks& engine, std::vector<Shard>& shards) {
  const PlanBlock* block = engine.begin;
  double done = 0.0;
  for (std::int64_t i = 0; i < engine.shards; ++i) {
    Shard shard{.name = block->engine,
                .begin = block->begin,
                .end = block->end,
                .cost = block->cost,
                .keys = {},
                .training = {}};
    const double until = engine.cost * static_cast<double>(i + 1) / static_cast<double>(engine.shards);
    const std::int64_t others = engine.shards - i - 1;  // each is to have a block at least
    // Up to the block whose middle lies behind the cut.
    for (++block; block != engine.end && engine.end - block > others; ++block) {
      const bool last = others == 0;
      if (!last && done + shard.cost + 0.5 * block->cost > until) break;
      shard.end = block->end;
      shard.cost += block->cost;
    }
    done += shard.cost;
    shards.push_back(std::move(shard));
  }
}

json to_json(const Shard& shard) {
  json object = {{"name", shard.name}, {"begin", shard.begin}, {"end", shard.end}, {"cost_s", shard.cost}};
  if (!shard.keys.empty()) object["keys"] = shard.keys;
  if (const PlannedTraining& training = shard.training; !training.train.empty())
    object.update(
        {{"train", training.train}, {"arm", training.arm}, {"seed", training.seed}, {"options", training.options}});
  return object;
}

[[noreturn]] void fail_plan(const std::string& what, const std::string& expected) {
  throw InputError(fmt::format("{}: expected {}", what, expected));
}

const json& list_at(JsonFields& fields, const std::string& key, const std::string& what) {
  const json& list = fields.at(key);
  if (!list.is_array()) fail_plan(what, fmt::format("a list under the key '{}'", key));
  return list;
}

// Everything that `duet train` is told follows from these, and all of it is known.
PlannedTraining read_training(JsonFields& fields, const std::string& name, const std::string& what) {
  PlannedTraining training{fields.text("train"), fields.text("arm"), fields.unsigned_integer("seed"), {}};
  const json& options = fields.at("options");
  if (!options.is_object()) fail_plan(what, "an object under the key 'options'");
  for (const auto& [option, value] : options.items()) {
    if (!value.is_string()) fail_plan(what, fmt::format("a text under the option '{}'", excerpt(option)));
    check_training_option(training.train, option, value.get<std::string>(), what);
    training.options[option] = value.get<std::string>();
  }
  const std::vector<std::string> known = training_names();
  if (std::ranges::find(known, training.train) == known.end())
    throw InputError(fmt::format("{}: {}", what, unknown_name_message("training", training.train, known)));
  if (!is_arm_name(training.arm))
    fail_plan(what, fmt::format("an arm of letters, digits, '_' and '.', found '{}'", excerpt(training.arm)));
  if (name != training.name())
    fail_plan(what, fmt::format("the name '{}' of its arm and seed, found '{}'", training.name(), excerpt(name)));
  return training;
}

Shard read_shard(const json& object, Kind kind, const std::string& what) {
  JsonFields fields(object, what);
  Shard shard;
  shard.name = fields.text("name");
  shard.begin = fields.integer("begin");
  shard.end = fields.integer("end");
  shard.cost = fields.number("cost_s");
  if (kind == Kind::kEpisodes) shard.keys = fields.text("keys");
  if (kind == Kind::kTrainings) shard.training = read_training(fields, shard.name, what);
  fields.refuse_unknown();
  if (shard.begin < 0 || shard.end <= shard.begin || shard.end - shard.begin > 10'000'000)
    fail_plan(what, fmt::format("0 <= begin < end, found {} and {}", shard.begin, shard.end));
  if (shard.cost < 0.0) fail_plan(what, fmt::format("a cost_s of at least 0, found {}", shard.cost));
  return shard;
}

// Each episode is in one shard.
void check_ranges(const ShardPlan& plan, const std::string& path) {
  std::int64_t next = 0;
  for (std::size_t i = 0; i < plan.shards.size() && plan.kind == Kind::kEpisodes; ++i) {
    const Shard& shard = plan.shards[i];
    if (shard.begin != next)
      fail_plan(fmt::format("{}: shard {}", path, i), fmt::format("begin {}, found {}", next, shard.begin));
    next = shard.end;
  }
  const std::int64_t all = plan.kind == Kind::kEpisodes ? next : static_cast<std::int64_t>(plan.shards.size());
  if (plan.shards.empty() || all != plan.episodes)
    fail_plan(path, fmt::format("shards of {} episodes together, found {}", plan.episodes, all));
}

ProgramDigests read_program(JsonFields& fields, const std::string& path) {
  const json& program = fields.at("program");
  const auto is_text = [](const json& digest) { return digest.is_string(); };
  if (!program.is_object() || !std::ranges::all_of(program, is_text) || !program.contains("duet"))
    fail_plan(path, "an object of digests, 'duet' among them, under the key 'program'");
  return program.get<ProgramDigests>();
}

PlannedClip read_clip(const json& object, const std::string& what) {
  JsonFields fields(object, what);
  PlannedClip clip{fields.text("task"), fields.text("id"), fields.text("file"), fields.text("sha256")};
  fields.refuse_unknown();
  const std::filesystem::path file = std::filesystem::path(clip.file).lexically_normal();
  if (file.empty() || file.is_absolute() || *file.begin() == "..")
    fail_plan(what, fmt::format("a file below the run directory, found '{}'", excerpt(clip.file)));
  return clip;
}

}  // namespace

std::vector<Shard> cut_shards(const std::vector<PlanBlock>& blocks, std::int64_t count) {
  std::vector<EngineBlocks> engines = by_engine(blocks);
  const auto least = static_cast<std::int64_t>(engines.size()), most = static_cast<std::int64_t>(blocks.size());
  if (count == 0) {
    for (const EngineBlocks& engine : engines)
      count +=
          std::clamp(static_cast<std::int64_t>(std::ceil(engine.cost / kShardSeconds)), std::int64_t{1}, engine.size());
  }
  require(count >= least && count <= most,
          "expected {} to {} shards (each is of one engine and of a clip at least), found {}", least, most, count);
  share_out(engines, count);
  std::vector<Shard> shards;
  for (const EngineBlocks& engine : engines) cut_engine(engine, shards);
  return shards;
}

bool is_arm_name(const std::string& name) {
  constexpr std::string_view kLetters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.";
  return !name.empty() && name.size() <= 64 && name.front() != '.' &&
         name.find_first_not_of(kLetters) == std::string::npos;
}

std::string plan_file(const std::string& run) { return (std::filesystem::path(run) / "plan.json").string(); }

bool has_shard_plan(const std::string& run) { return std::filesystem::exists(plan_file(run)); }

void write_shard_plan(const ShardPlan& plan, const std::string& run) {
  json clips = json::array(), shards = json::array();
  for (const PlannedClip& clip : plan.clips)
    clips.push_back({{"task", clip.task}, {"id", clip.id}, {"file", clip.file}, {"sha256", clip.sha256}});
  for (const Shard& shard : plan.shards) shards.push_back(to_json(shard));
  const json object = {{"schema", kPlanSchema},     {"kind", plan.kind == Kind::kEpisodes ? "episodes" : "trainings"},
                       {"program", plan.program},   {"suite_hash", plan.suite_hash},
                       {"episodes", plan.episodes}, {"clips", std::move(clips)},
                       {"costs", plan.costs},       {"shards", std::move(shards)}};
  write_file(join_without_links(run, "plan.json"), dumped(object, 1) + "\n");
}

ShardPlan read_shard_plan(const std::string& run) {
  const std::string path = plan_file(run);
  if (!has_shard_plan(run))
    throw InputError(fmt::format("'{}' is no run that was planned (no plan.json): `duet plan` makes one", run));
  require_plain_files(run);
  const json object = parse_json(read_text(path), path);
  JsonFields fields(object, path);
  if (const std::string schema = fields.text("schema"); schema != kPlanSchema)
    fail_plan(path, fmt::format("schema {}, found {}", kPlanSchema, excerpt(schema)));
  const std::string kind = fields.text("kind");
  if (kind != "episodes" && kind != "trainings")
    fail_plan(path, fmt::format("kind 'episodes' or 'trainings', found '{}'", excerpt(kind)));
  ShardPlan plan;
  plan.kind = kind == "episodes" ? Kind::kEpisodes : Kind::kTrainings;
  plan.program = read_program(fields, path);
  plan.suite_hash = fields.text("suite_hash");
  plan.episodes = fields.integer("episodes");
  plan.costs = fields.numbers("costs", false);
  for (const json& clip : list_at(fields, "clips", path))
    plan.clips.push_back(read_clip(clip, fmt::format("{}: clip {}", path, plan.clips.size())));
  for (const json& shard : list_at(fields, "shards", path))
    plan.shards.push_back(read_shard(shard, plan.kind, fmt::format("{}: shard {}", path, plan.shards.size())));
  fields.refuse_unknown();
  if (std::ssize(plan.shards) > kMostShards) fail_plan(path, fmt::format("at most {} shards", kMostShards));
  check_ranges(plan, path);
  return plan;
}

std::string shard_plan_digest(const std::string& run) { return sha256_file(plan_file(run)); }

const Shard& shard_of(const ShardPlan& plan, std::int64_t number) {
  require(number >= 0 && number < std::ssize(plan.shards), "expected a shard of 0 to {}, found {}",
          plan.shards.size() - 1, number);
  return plan.shards[static_cast<std::size_t>(number)];
}

ProgramDigests program_digests(const std::vector<std::string>& engines) {
  ProgramDigests digests = {{"duet", sha256_file("/proc/self/exe")}};
  for (const std::string& engine : engines) {
    if (engine == kPlaybackEngine) continue;
    try {
      Dl_info module{};
      const bool found = dladdr(&engine_module(engine), &module) != 0 && module.dli_fname != nullptr;
      digests[engine] = found ? sha256_file(module.dli_fname) : "";
    } catch (const MissingError&) {
      digests[engine] = "";
    } catch (const std::invalid_argument&) {
      digests[engine] = "";  // a module of somebody's own that is not here
    }
  }
  return digests;
}

void require_same_program(const ProgramDigests& planned, const ProgramDigests& here, const std::string& run) {
  for (const auto& [name, digest] : planned) {
    const auto found = here.find(name);
    const std::string other = found == here.end() ? "" : found->second;
    if (other == digest) continue;
    throw InputError(fmt::format(
        "'{}' was planned with {} {}, this machine has {}: rows of two programs are not one run; give every node the "
        "same build, or plan anew",
        run, name == "duet" ? "the program" : "the engine " + name, short_digest(digest), short_digest(other)));
  }
}

}  // namespace duet
