#include "ask.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <iostream>
#include <optional>

#include "berth/base/words.hpp"
#include "berth/command/execute.hpp"
#include "berth/command/verbs.hpp"
#include "berth/text/printable.hpp"
#include "berth/text/quantity.hpp"
#include "execute.hpp"
#include "output.hpp"

namespace berth::cli {

using operate::Event;

bool someone_types() noexcept { return ::isatty(STDIN_FILENO) == 1; }

namespace {

// Reads from a terminal, which gives a whole line at once. Nothing: the input ended, or a signal came.
std::optional<std::string> typed_line(Interrupt& interrupt) {
  if (interrupt.came()) return std::nullopt;
  std::array<pollfd, 2> wait{pollfd{STDIN_FILENO, POLLIN, 0}, pollfd{interrupt.descriptor(), POLLIN, 0}};
  ::poll(wait.data(), wait.size(), -1);
  std::string line;
  if (interrupt.came() || !std::getline(std::cin, line)) return std::nullopt;
  return line;
}

}  // namespace

std::optional<std::string> ask_line(const std::string& question, Interrupt& interrupt) {
  write_text(text::one_line(question) + " ");
  auto line = typed_line(interrupt);
  if (!line) return line;
  constexpr const char* blanks = " \t\r";
  line->erase(0, std::min(line->find_first_not_of(blanks), line->size()));
  line->erase(line->find_last_not_of(blanks) + 1);
  return line;
}

bool ask_yes(const std::string& question, Interrupt& interrupt) {
  write_text(text::one_line(question) + " [y/N] ");
  const auto answer = typed_line(interrupt);
  return answer == "y" || answer == "yes";
}

std::vector<std::string> lines_of(const Event& question) {
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < question.devices.size(); ++i) {
    lines.push_back(fmt::format("  {}  {}", i + 1, question.devices[i]));
  }
  lines.push_back(fmt::format("type a slot ({}) and the number of its device", some_of(question.slots, 4)));
  return lines;
}

namespace {

// The user may name the slot by its name or its node-ID, as in every command.
std::string slot_typed(const Event& question, const std::string& word, const design::Machine& machine) {
  const auto asked = [&](const std::string& name) {
    return std::ranges::find(question.slots, name) != question.slots.end();
  };
  const auto id = text::parse_ranges(word, 1, 127);
  if (asked(word) || !id || id->size() != 1) return word;
  for (const auto& slot : machine.slots) {
    if (slot.spec.id.value() == id->front() && slot.spec.name.bus == question.bus && asked(slot.spec.name.name))
      return slot.spec.name.name;
  }
  return word;
}

}  // namespace

command::Request answer_of(const Event& question, const std::string& line, const design::Machine& machine,
                           std::string& problem) {
  const auto end = line.find_last_not_of(" \t\r");
  const std::string text = end == std::string::npos ? "" : line.substr(0, end + 1);
  const auto space = text.find_last_of(" \t");
  const auto no = [&](std::string why) {
    problem = std::move(why);
    return command::Request{};
  };
  if (space == std::string::npos) return no("type a slot and the number of its device, such as \"left 2\"");
  const auto last = text.find_last_not_of(" \t", space);
  const std::string slot = slot_typed(question, last == std::string::npos ? "" : text.substr(0, last + 1), machine);
  const auto most = static_cast<unsigned>(question.devices.size());
  const auto number = text::parse_ranges(text.substr(space + 1), 1, std::max(1U, most));
  if (std::ranges::find(question.slots, slot) == question.slots.end()) {
    return no(fmt::format("{} is not one of the slots ({}); type one of them and the number of its device, such as {}",
                          text::quoted(slot), some_of(question.slots, 4),
                          text::quoted(question.slots.empty() ? "left 1" : question.slots.front() + " 1")));
  }
  if (!number || number->size() != 1 || most == 0) {
    return no(fmt::format("{} is not a number from 1 to {}", text::quoted(text.substr(space + 1)), most));
  }
  problem.clear();
  return {"replace", {{"bus", question.bus}, {"slot", slot}, {"device", question.devices[number->front() - 1]}}};
}

// ---- during a run ----

struct Asker::Answer {
  command::Request request;
  command::Reply reply;
  bool over = false;
};

namespace {

std::vector<Event> open_questions(const tree::Session& session) { return tree::questions_of(session); }

}  // namespace

Asker::Asker(tree::Session& session, io::Loop& loop, FirstSaves& saves, std::function<void(const std::string&)> say,
             bool takes_lines)
    : session_(&session),
      loop_(&loop),
      saves_(&saves),
      say_(std::move(say)),
      takes_lines_(takes_lines),
      scope_(session.executor()) {}

Asker::~Asker() {
  if (!takes_lines_) loop_->forget(STDIN_FILENO);
  scope_.cancel();
}

void Asker::event(const Event& event) {
  if (event.kind != operate::EventKind::question || (event.devices.empty() && !event.offers_save)) return;
  if (!event.devices.empty()) {
    for (const auto& line : lines_of(event)) say_(line);
  }
  if (!over_ && !takes_lines_) loop_->watch(STDIN_FILENO, *this, EPOLLIN);
}

// Text typed while no question is open is left for the shell.
void Asker::ready(std::uint32_t) noexcept {
  if (asks()) read_typed();
  if (over_ || !asks()) loop_->forget(STDIN_FILENO);
}

bool Asker::asks() const { return saves_->is_open() || !open_questions(*session_).empty(); }

void Asker::read_typed() {
  std::array<char, 256> bytes{};
  const auto count = ::read(STDIN_FILENO, bytes.data(), bytes.size());
  if (count <= 0) {
    over_ = true;
    return;
  }
  typed_.append(bytes.data(), static_cast<std::size_t>(count));
  for (auto end = typed_.find('\n'); end != std::string::npos; end = typed_.find('\n')) {
    const std::string line = typed_.substr(0, end);
    typed_.erase(0, end + 1);
    take(line);
  }
}

void Asker::report_answers() noexcept {
  std::erase_if(answers_, [&](const auto& answer) {
    if (!answer->over) return false;
    if (!answer->reply.error.empty()) say_(answer->reply.error);
    return true;
  });
}

void Asker::take(const std::string& line) {
  if (saves_->take(line)) return;
  std::string problem = "nothing is asked now";
  for (const auto& question : open_questions(*session_)) {
    auto request = answer_of(question, line, session_->machine(), problem);
    if (request.verb.empty()) continue;
    auto answer = std::make_unique<Answer>();
    answer->request = std::move(request);
    answers_.push_back(std::move(answer));
    Answer& mine = *answers_.back();
    scope_.spawn(
        rt::told(command::execute(*session_, mine.request, mine.reply), mine.over, session_->executor(), reporting_));
    return;
  }
  say_(problem);
}

bool Asker::take(char key) {
  if (key == '?') {
    say_(
        "q or Ctrl-C ends the run; arrows, Page Up, Page Down, Home and End move the table; other commands are typed "
        "in another terminal: berth status, berth replace SLOT");
    for (const auto& line : help_) say_(line);
    if (asks()) say_("a question is open: type the slot and the number of its device, such as \"left 2\", and Enter");
    return true;
  }
  const bool ends = key == 'q' && !asks();
  if (ends) ::raise(SIGINT);
  return ends;
}

// ---- in a paused world ----

void ask_here(MachineRun& run, rt::Duration limit) {
  for (;;) {
    const auto questions = open_questions(run.session());
    const auto question = std::ranges::find_if(questions, [](const Event& q) { return !q.devices.empty(); });
    if (question == questions.end()) return;
    print_line(fmt::format("bus {}: {}", question->bus, question->text));
    print_lines(lines_of(*question));
    const auto line = typed_line(run.interrupt());
    if (!line || line->empty()) return;
    std::string problem;
    const auto request = answer_of(*question, *line, run.session().machine(), problem);
    if (request.verb.empty()) {
      print_error(problem);
      continue;
    }
    command::Reply reply;
    if (!execute_in(run, request, reply, limit)) return;
    if (!reply.error.empty()) print_errors(reply.error);
  }
}

}  // namespace berth::cli
