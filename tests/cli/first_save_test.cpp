// `berth up` with a device that has to save its parameters once before it becomes operational (CANopenNode without
// storage files): what is told, what is asked, and what --yes does.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "running_fixture.hpp"

namespace berth::test {
namespace {

std::string unsaved_plant() {
  std::string text = small_plant;
  const auto at = text.find("[[device]]");
  return text.insert(at + std::string("[[device]]").size(), "\nneeds_first_save = true");
}

class FirstSave : public Running {
 protected:
  FirstSave() : unsaved(folder.write("unsaved.toml", unsaved_plant())) {}
  std::string unsaved;
};

TEST_F(FirstSave, UpSaysWhatToDo) {
  const Outcome up = berth({"up", machine, "--sim", unsaved, "--fast"});
  EXPECT_EQ(up.status, 1) << up.out;
  EXPECT_TRUE(contains(up.out, "save its parameters (1010h:01) and reset it")) << up.out;
  EXPECT_TRUE(contains(up.err, "berth store")) << up.err;
}

TEST_F(FirstSave, YesSavesResetsAndGoesOn) {
  const Outcome up = berth({"up", machine, "--sim", unsaved, "--fast", "--yes", "--until", "operational"});
  EXPECT_EQ(up.status, 0) << up.out << up.err;
  EXPECT_TRUE(contains(up.out, "its parameters are saved, and it was reset")) << up.out;
}

TEST_F(FirstSave, OnATerminalItIsAsked) {
  up_ = std::make_unique<Background>(Words{"up", machine, "--sim", unsaved, "--control", socket}, OnTerminal{});
  ASSERT_TRUE(up_->says("type: save right"));
  up_->type("save nobody\n");
  EXPECT_TRUE(up_->says("nothing is asked now")) << "what is no answer is told";
  up_->type("save right\n");
  EXPECT_TRUE(wait_for("right", "operational"));
}

}  // namespace
}  // namespace berth::test
