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

[[noreturn]] void fail_plan(const std::string& what, const std::string& expected) {
  throw InputError(fmt::format("{}: expected {}", what, expected));
}

const JsonSchema<Shard>& shard_schema(Kind kind) {
  using S = Shard;
  static const JsonSchema<S> common = {{{"name"}, &S::name},
                                       {{"begin"}, &S::begin},
                                       {{"end"}, &S::end},
                                       {{.name = "cost_s", .unit = "s", .range = {.low = 0.0}}, &S::cost}};
  static const JsonSchema<S> episodes = [] {
    JsonSchema<S> keys = common;
    keys.emplace_back(FieldDoc{"keys"}, &S::keys);
    return keys;
  }();
  static const JsonSchema<S> trainings = [] {
    using T = PlannedTraining;
    JsonSchema<S> keys = common;
    for (JsonKey<S>& key : json_keys<S, T>(
             &S::training,
             {{{"train"}, &T::train}, {{"arm"}, &T::arm}, {{"seed"}, &T::seed}, {{"options"}, &T::options}}))
      keys.push_back(std::move(key));
    return keys;
  }();
  return kind == Kind::kEpisodes ? episodes : trainings;
}

// Everything that `duet train` is told follows from these, and all of it is known.
void check_training(const Shard& shard, const std::string& what) {
  const PlannedTraining& training = shard.training;
  const std::vector<std::string> known = training_names();
  if (std::ranges::find(known, training.train) == known.end())
    throw InputError(fmt::format("{}: {}", what, unknown_name_message("training", training.train, known)));
  for (const auto& [option, value] : training.options) check_training_option(training.train, option, value, what);
  if (!is_arm_name(training.arm))
    fail_plan(what, fmt::format("an arm of letters, digits, '_' and '.', found '{}'", excerpt(training.arm)));
  if (shard.name != training.name())
    fail_plan(what, fmt::format("the name '{}' of its arm and seed, found '{}'", training.name(), excerpt(shard.name)));
}

JsonKey<ShardPlan> shards_key() {
  const auto write = [](const ShardPlan& plan) {
    json list = json::array();
    for (const Shard& shard : plan.shards) list.push_back(json_mapping(shard, shard_schema(plan.kind)));
    return list;
  };
  const auto read = [](const JsonNode& list, ShardPlan& plan) {
    list.require_list();
    for (std::size_t i = 0; i < list.value().size(); ++i) {
      const JsonNode node = list.element(i);
      Shard& shard = plan.shards.emplace_back();
      read_mapping(node, shard_schema(plan.kind), shard);
      if (plan.kind == Kind::kTrainings) check_training(shard, node.place());
      if (shard.end <= shard.begin || shard.end - shard.begin > 10'000'000)
        fail_plan(node.place(), fmt::format("0 <= begin < end, found {} and {}", shard.begin, shard.end));
    }
  };
  return {{"shards"}, "list of objects", write, read};
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

void check_clip(const PlannedClip& clip, const std::string& path) {
  const std::filesystem::path file = std::filesystem::path(clip.file).lexically_normal();
  if (file.empty() || file.is_absolute() || *file.begin() == "..")
    fail_plan(fmt::format("{}: clip '{}'", path, excerpt(clip.id)),
              fmt::format("a file below the run directory, found '{}'", excerpt(clip.file)));
}

}  // namespace

template <>
const JsonSchema<PlannedClip>& json_schema<PlannedClip>() {
  using C = PlannedClip;
  static const JsonSchema<C> schema = {
      {{"task"}, &C::task}, {{"id"}, &C::id}, {{"file"}, &C::file}, {{"sha256"}, &C::sha256}};
  return schema;
}

// The kind comes first: it says which keys a shard has.
template <>
const JsonSchema<ShardPlan>& json_schema<ShardPlan>() {
  using P = ShardPlan;
  static const JsonSchema<P> schema = {{{.name = "kind", .choices = {"episodes", "trainings"}}, &P::kind},
                                       {{"program"}, &P::program},
                                       {{"suite_hash"}, &P::suite_hash},
                                       {{"episodes"}, &P::episodes},
                                       {{"clips"}, &P::clips},
                                       {finite_key("costs"), &P::costs},
                                       shards_key()};
  return schema;
}

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
  write_file(join_without_links(run, "plan.json"), dumped(json_document(kPlanSchema, plan), 1) + "\n");
}

ShardPlan read_shard_plan(const std::string& run) {
  const std::string path = plan_file(run);
  if (!has_shard_plan(run))
    throw InputError(fmt::format("'{}' is no run that was planned (no plan.json): `duet plan` makes one", run));
  require_plain_files(run);
  auto plan = read_document<ShardPlan>(read_text(path), path, kPlanSchema);
  if (!plan.program.contains("duet"))
    fail_plan(path, "the digest of 'duet' among others under the key 'program', found none");
  for (const PlannedClip& clip : plan.clips) check_clip(clip, path);
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
