#include "duet/policies/language.h"

#include <fmt/format.h>

#include <cmath>

#include "duet/archives/npy/npz.h"
#include "duet/core/digest.h"
#include "duet/core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

constexpr double kFloat = 1e-6;  // rounding of 768 floats of a unit vector

using Commands = std::vector<std::pair<Task, std::string>>;

Task nearest_task(const LanguageEncoder& encoder, const std::string& prompt) {
  const std::vector<float> embedding = encoder.embed(prompt);
  Task best = Task::kHug;
  double largest = -2.0;
  for (const Task task : all_tasks()) {
    const double similar = cosine(embedding, encoder.embed(task_prompt(task)));
    if (similar > largest) best = task;
    largest = std::max(largest, similar);
  }
  return best;
}

double accuracy(const LanguageEncoder& encoder, const Commands& commands, const char* of) {
  int right = 0;
  for (const auto& [task, text] : commands) {
    const Task found = nearest_task(encoder, text);
    right += found == task ? 1 : 0;
    if (found != task) fmt::print("  '{}': {} for {}\n", text, to_string(found), to_string(task));
  }
  const double rate = static_cast<double>(right) / static_cast<double>(commands.size());
  fmt::print("nearest prompt is the right task: {}/{} ({:.1f} %) of {}\n", right, commands.size(), 100.0 * rate, of);
  return rate;
}

Commands paraphrases_but_prompts() {
  Commands commands;
  for (const Task task : all_tasks())
    for (const std::string_view text : task_paraphrases(task))
      if (text != task_prompt(task)) commands.emplace_back(task, text);
  return commands;
}

// Written once, beside the lexicon and never used to change it.
Commands held_out() {
  return {{Task::kHug, "could you hug me please"},
          {Task::kHug, "a big bear hug"},
          {Task::kHug, "throw your arms around your friend"},
          {Task::kHug, "comfort the visitor with an embrace"},
          {Task::kHug, "hugs for everyone"},
          {Task::kHandshake, "shake on it"},
          {Task::kHandshake, "introduce yourself with a handshake"},
          {Task::kHandshake, "shake the visitor's right hand"},
          {Task::kHandshake, "put your hand in theirs and shake"},
          {Task::kHandshake, "seal the deal by shaking hands"},
          {Task::kHighFive, "high five!"},
          {Task::kHighFive, "gimme five"},
          {Task::kHighFive, "smack palms with your friend"},
          {Task::kHighFive, "slap the raised hand"},
          {Task::kHighFive, "a celebratory high-five"},
          {Task::kWave, "wave at the crowd"},
          {Task::kWave, "say goodbye"},
          {Task::kWave, "move your hand from side to side in greeting"},
          {Task::kWave, "greet the visitor by waving"},
          {Task::kWave, "signal hello with your arm"},
          {Task::kBend, "bow deeply"},
          {Task::kBend, "bend over"},
          {Task::kBend, "a respectful bow"},
          {Task::kBend, "bend your knees and back"},
          {Task::kBend, "lean over in greeting"},
          {Task::kFlyKiss, "blow kisses to the crowd"},
          {Task::kFlyKiss, "send her a kiss"},
          {Task::kFlyKiss, "kiss through the air"},
          {Task::kFlyKiss, "toss a kiss across the room"},
          {Task::kFlyKiss, "flying kisses"}};
}

TEST(Language, ParaphrasesAreNearestToTheirTask) {
  const auto encoder = built_in_language();
  const Commands commands = paraphrases_but_prompts();
  ASSERT_GE(commands.size(), 6U * 8U);
  EXPECT_GE(accuracy(*encoder, commands, "paraphrases"), 0.95);
}

TEST(Language, CommandsThatTheLexiconWasNotMadeForAreMostlyUnderstood) {
  EXPECT_GE(accuracy(*built_in_language(), held_out(), "held-out commands"), 0.8);
}

TEST(Language, CommandsOfOneTaskAreNearerThanOfTwo) {
  const auto encoder = built_in_language();
  double within = 0.0, between = 0.0;
  int same = 0, different = 0;
  const Commands commands = paraphrases_but_prompts();
  std::vector<std::vector<float>> embeddings;
  embeddings.reserve(commands.size());
  for (const auto& [task, text] : commands) embeddings.push_back(encoder->embed(text));
  for (std::size_t i = 0; i < commands.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double similar = cosine(embeddings[i], embeddings[j]);
      const bool one_task = commands[i].first == commands[j].first;
      (one_task ? within : between) += similar;
      (one_task ? same : different) += 1;
    }
  }
  within /= same;
  between /= different;
  fmt::print("mean cosine within a task {:.3f}, between tasks {:.3f}\n", within, between);
  EXPECT_GT(within, between + 0.4);
}

TEST(Language, AnEmbeddingHasTheSizeOfThePaperAndUnitLength) {
  const auto encoder = built_in_language();
  EXPECT_EQ(encoder->name(), kBuiltInLanguage);
  for (const char* text : {"hug", "shake hands with the person", "zzz", "caf\xC3\xA9", "5", "the"}) {
    const std::vector<float> embedding = encoder->embed(text);
    ASSERT_EQ(static_cast<int>(embedding.size()), kLanguageSize);
    ASSERT_EQ(encoder->size(), kLanguageSize);
    double square = 0.0;
    for (const float x : embedding) square += static_cast<double>(x) * x;
    EXPECT_NEAR(square, 1.0, kFloat) << text;
  }
}

// Bits that a network was trained on: a change of them needs another name than duet-text-1.
TEST(Language, TheSameTextGivesTheSameBitsInEveryVersion) {
  const std::vector<float> embedding = built_in_language()->embed("shake hands with the person");
  EXPECT_EQ(embedding, built_in_language()->embed("shake hands with the person"));
  EXPECT_EQ(fmt::format("{:a} {:a} {:a}", embedding[0], embedding[1], embedding[767]),
            "-0x1.485e7ep-5 -0x1.5b1de8p-6 0x1.c8f6b4p-7");
}

// A task that is added brings phrases of its own and changes no command of the six.
TEST(Language, EveryCommandOfTheSixGivesTheBitsThatNetworksLearntFrom) {
  const auto encoder = built_in_language();
  Sha256 hash;
  for (const Task task : kPaperTasks) {
    std::vector<std::string_view> texts = {task_prompt(task)};
    for (const std::string_view text : task_paraphrases(task)) texts.push_back(text);
    for (const std::string_view text : texts) {
      const std::vector<float> embedding = encoder->embed(text);
      hash.update(std::span<const double>(std::vector<double>(embedding.begin(), embedding.end())));
    }
  }
  EXPECT_EQ(hash.hex(), "23ab26d928aae0b54228ee4f914e6e5b3d0887a74316ae6cd812534e9cb73e87");
}

TEST(Language, TheCommandToBeginIsTheSameTasksAndAnotherCommand) {
  const auto encoder = built_in_language();
  for (const Task task : kPaperTasks) {
    const std::string leads = leading_prompt(task_prompt(task));
    EXPECT_EQ(nearest_task(*encoder, leads), task);
    EXPECT_TRUE(is_leading(leads));
    EXPECT_FALSE(is_leading(task_prompt(task)));
    EXPECT_LT(cosine(encoder->embed(leads), encoder->embed(task_prompt(task))), 0.99);
  }
}

TEST(Language, CaseOrderAndPunctuationDoNotMatter) {
  const auto encoder = built_in_language();
  EXPECT_EQ(encoder->embed("High-FIVE them!"), encoder->embed("high five, them"));
  EXPECT_EQ(encoder->embed("wave wave wave"), encoder->embed("wave"));
  EXPECT_GT(cosine(encoder->embed("hugging"), encoder->embed("hugs")), 1.0 - kFloat);
}

// Words that no lexicon knows are told apart by their letters.
TEST(Language, UnknownWordsOfLikeSpellingAreNearEachOther) {
  const auto encoder = built_in_language();
  const std::vector<float> wrong = encoder->embed("pirouete");
  EXPECT_GT(cosine(wrong, encoder->embed("pirouette")), cosine(wrong, encoder->embed("somersault")) + 0.1);
}

TEST(Language, APromptWithoutAWordIsRefused) {
  const auto encoder = built_in_language();
  for (const char* text : {"", "  ", "?!", "''"})
    EXPECT_EQ(thrown_message<std::invalid_argument>([&] { (void)encoder->embed(text); }),
              fmt::format("language: expected a prompt with a word, found '{}'", text));
}

TEST(Language, EveryTaskHasAPromptAndEightParaphrases) {
  for (const Task task : all_tasks()) {
    EXPECT_FALSE(task_prompt(task).empty());
    EXPECT_GE(task_paraphrases(task).size(), 8U);
    EXPECT_EQ(nearest_task(*built_in_language(), std::string(task_prompt(task))), task);
  }
}

Npz table() {
  Npz archive;
  archive.set_text("name", "my-encoder");
  archive.set("prompts", std::vector<std::string>{"hug the person", "wave"});
  archive.set("embeddings", std::vector<double>{3.0, 0.0, 4.0, 0.0, -2.0, 0.0}, {2, 3});
  return archive;
}

std::unique_ptr<LanguageEncoder> load(const Npz& archive) {
  const test::ScratchFolder folder;
  archive.save(folder / "table.npz");
  return load_language_table(folder / "table.npz");
}

TEST(LanguageTable, GivesItsRowsAtUnitLength) {
  const auto encoder = load(table());
  EXPECT_EQ(encoder->name(), "my-encoder");
  EXPECT_EQ(encoder->size(), 3);
  EXPECT_EQ(encoder->embed("Hug the person."), (std::vector<float>{0.6F, 0.0F, 0.8F}));
  EXPECT_EQ(encoder->embed("wave"), (std::vector<float>{0.0F, -1.0F, 0.0F}));
}

TEST(LanguageTable, APromptThatItLacksIsRefusedWithTheNearest) {
  const auto encoder = load(table());
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)encoder->embed("hug a person"); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)encoder->embed(" "); }));
}

TEST(LanguageTable, BadTablesAreRefused) {
  const auto refusal = [](auto change) {
    Npz archive = table();
    change(archive);
    return thrown_message<InputError>([&] { (void)load(archive); });
  };
  EXPECT_SENTENCE(refusal([](Npz& npz) { npz.set("prompts", std::vector<std::string>{"wave", "Wave!"}); }));
  EXPECT_SENTENCE(refusal([](Npz& npz) { npz.set("prompts", std::vector<std::string>{"wave", "!"}); }));
  EXPECT_SENTENCE(refusal([](Npz& npz) { npz.set("embeddings", std::vector<double>(6, 0.0), {2, 3}); }));
  EXPECT_SENTENCE(refusal([](Npz& npz) { npz.set("embeddings", std::vector<double>(3, 1.0), {1, 3}); }));
  EXPECT_SENTENCE(refusal([](Npz& npz) { npz.set("embeddings", std::vector<double>(6, std::nan("")), {2, 3}); }));
  EXPECT_SENTENCE(refusal([](Npz& npz) {
    npz.set("prompts", std::vector<std::string>{});
    npz.set("embeddings", std::vector<double>{}, {0, 3});
  }));
  EXPECT_SENTENCE(thrown_message<MissingError>([] { (void)load_language_table("/nowhere.npz"); }));
}

TEST(Language, CosineOfVectorsOfTwoSizesIsRefused) {
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { (void)cosine({1.0F}, {1.0F, 2.0F}); }));
  EXPECT_EQ(cosine({0.0F}, {1.0F}), 0.0);
}

}  // namespace
}  // namespace duet
