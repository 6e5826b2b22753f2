// Two `berth up` on one bus as flying masters (docs/flying-master.md), each a process of its own on a plant's socket.
#include <gtest/gtest.h>

#include <csignal>
#include <memory>
#include <optional>

#include "command_fixture.hpp"

namespace berth::test {
namespace {

class TwoBerths : public Command {
 protected:
  void SetUp() override {
    plant_ = std::make_unique<Background>(
        Words{"plant", example("five-slaves.plant.toml"), "--listen", socket_, "--machine", two_masters_});
    ASSERT_TRUE(plant_->says("Ctrl-C ends it"));
  }
  [[nodiscard]] std::unique_ptr<Background> up(const std::string& name, const Words& more) const {
    Words words{"up",
                two_masters_,
                "--port",
                "plant:" + socket_,
                "--store",
                folder.file(name + ".db"),
                "--pace",
                "--control",
                folder.file(name + ".sock"),
                "--yes"};
    words.insert(words.end(), more.begin(), more.end());
    return std::make_unique<Background>(words);
  }
  // What `berth status` of this one says; empty: it does not answer.
  [[nodiscard]] std::optional<Json> status(const std::string& name) const {
    const Outcome outcome = berth({"status", "--control", folder.file(name + ".sock"), "--json"});
    if (outcome.status > 1 || outcome.out.empty()) return std::nullopt;
    return Json::parse(outcome.out);
  }
  [[nodiscard]] bool is_active(const std::string& name) const {
    const auto json = status(name);
    return json && json->at("masters").at(0).at("here") == true;
  }
  [[nodiscard]] bool is_operational(const std::string& name) const {
    return berth({"status", "--control", folder.file(name + ".sock"), "--json"}).status == 0;
  }

  std::string two_masters_ = example("two-masters.toml");
  std::string socket_ = folder.file("plant.sock");
  std::unique_ptr<Background> plant_;
};

}  // namespace

// The first one is killed as by a power cut; `berth status` of the second says who is master, then and before.
TEST_F(TwoBerths, TheSecondTakesOverWhenTheFirstIsKilled) {
  auto first = up("first", {});
  ASSERT_TRUE(eventually([&] { return is_active("first") && is_operational("first"); }));
  const auto second = up("second", {"--master-id", "126", "--priority", "2"});
  ASSERT_TRUE(eventually([&] {
    const auto json = status("second");
    return json && json->at("masters").at(0).at("node") == 127;
  }));
  EXPECT_FALSE(is_active("second"));
  const Outcome table = berth({"status", "--control", folder.file("second.sock")});
  EXPECT_NE(table.out.find("field: node 127 is the active NMT master (priority 1)"), std::string::npos) << table.out;
  EXPECT_NE(table.out.find("unknown"), std::string::npos) << table.out;

  first->signal(SIGKILL);
  static_cast<void>(first->end());
  EXPECT_TRUE(eventually([&] { return is_active("second") && is_operational("second"); }));
  const auto json = status("second");
  ASSERT_TRUE(json);
  EXPECT_EQ(json->at("masters").at(0).at("node"), 126);
}

TEST_F(TwoBerths, WordsThatMakeNoSense) {
  const Outcome slot = berth({"up", two_masters_, "--port", "plant:" + socket_, "--master-id", "3"});
  EXPECT_EQ(slot.status, 2);
  EXPECT_NE(slot.err.find("--master-id 3: slot 's3' has this node-ID"), std::string::npos) << slot.err;
  const Outcome alone = berth({"up", example("five-slaves.toml"), "--port", "plant:" + socket_, "--priority", "0"});
  EXPECT_EQ(alone.status, 2);
  EXPECT_NE(alone.err.find("[bus.NAME.flying_master]"), std::string::npos) << alone.err;
}

}  // namespace berth::test
