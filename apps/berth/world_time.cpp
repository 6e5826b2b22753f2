#include "world_time.hpp"

#include <fmt/format.h>

#include <charconv>
#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/command/arguments.hpp"
#include "berth/operate/report.hpp"
#include "plant_commands.hpp"

namespace berth::cli {

using command::Reply;
using command::Request;
using Json = nlohmann::ordered_json;

namespace {

constexpr unsigned most_frames = 10'000;
constexpr rt::Duration longest_step = std::chrono::seconds(10);
constexpr double slowest = 0.01;
constexpr double fastest = 1000;

std::optional<double> factor_of(const std::string& text) {
  double factor = 0;
  const char* const end = text.data() + text.size();
  const auto [last, error] = std::from_chars(text.data(), end, factor);
  const bool good = error == std::errc{} && last == end && factor >= slowest && factor <= fastest;
  return good ? std::optional(factor) : std::nullopt;
}

}  // namespace

bool WorldTime::is_its(const Request& request) noexcept { return request.verb.starts_with("world "); }

std::optional<Reply> WorldTime::refusal_of(const Request& request) {
  const command::Arguments arguments(request);
  if (!arguments.good()) return command::refusal(Exit::usage, arguments.problem());
  if (run_->world() == nullptr)
    return command::refusal(Exit::no, "no bus of this machine is simulated in this process: time is the clock's");
  if (request.verb != "world damage" && !run_->guards().empty())
    return command::refusal(Exit::no, "a bus of this machine is outside this process: its time cannot be held");
  return std::nullopt;
}

Reply WorldTime::told(const std::string& words) {
  const io::Loop& loop = *run_->loop();
  const double now = operate::seconds(run_->now());
  Reply reply;
  reply.json = Json{{"time_s", now}, {"paused", loop.paused()}, {"speed", loop.speed()}}.dump();
  reply.lines = {fmt::format("{}; world time is {:.6f} s", words, now)};
  return reply;
}

WorldTime::Waiting::Waiting(WorldTime* time, const Reply& reply) : time_(time), reply_(&reply) {
  if (time_ != nullptr) time_->waiting_.push_back(reply_);
}

WorldTime::Waiting::~Waiting() {
  if (time_ != nullptr) std::erase(time_->waiting_, reply_);
}

void WorldTime::stand() {
  const bool stood = run_->loop()->paused();
  run_->loop()->pause(true);
  if (stood) return;
  for (const Reply* const reply : waiting_) reply->tell("the world is " + standing());
}

Reply WorldTime::set(const Request& request) {
  io::Loop& loop = *run_->loop();
  if (request.verb == "world pause") {
    stand();
    return told("the world is paused");
  }
  if (request.verb == "world run") {
    loop.pause(false);
    return told("the world runs");
  }
  const auto factor = factor_of(request.arguments.at("factor"));
  if (!factor)
    return command::refusal(Exit::usage,
                            fmt::format("factor: a number from {} to {}, 1 is real time", slowest, fastest));
  loop.set_speed(*factor);
  return told(fmt::format("{} times as fast as real time", *factor));
}

Reply WorldTime::damage(const Request& request) {
  Request event{plant_verb,
                {{"action", "disturb"}, {"bit_from_end", "10"}, {"kind", "flip"}, {"spare_senders", "true"}}};
  const auto bus = request.arguments.find("bus");
  if (bus != request.arguments.end()) event.arguments["bus"] = bus->second;
  const auto from = request.arguments.find("from");
  if (from != request.arguments.end()) event.arguments["sender"] = from->second;
  command::Arguments arguments(request);
  event.arguments["times"] = std::to_string(arguments.number("frames", 1, most_frames, 1));
  if (!arguments.good()) return command::refusal(Exit::usage, arguments.problem());
  return do_in_plant({run_->world(), &run_->plant(), &run_->session()}, event);
}

rt::Task<void> WorldTime::carry_out(const Request& request, Reply& reply) {
  if (auto no = refusal_of(request)) {
    reply = std::move(*no);
    co_return;
  }
  if (request.verb == "world damage") {
    reply = damage(request);
    co_return;
  }
  if (request.verb != "world step") {
    reply = set(request);
    co_return;
  }
  command::Arguments arguments(request);
  const unsigned frames = arguments.number("frames", 1, most_frames, 1);
  if (!arguments.good()) {
    reply = command::refusal(Exit::usage, arguments.problem());
    co_return;
  }
  if (frames_) {
    reply = command::refusal(Exit::no, "a step is under way already: try again");
    co_return;
  }
  stand();
  stepped_.clear();
  frames_ = frames;
  const auto came = co_await stepped_.next(rt::never);
  reply = told(counted(came.value_or(0), "frame") + " passed");
  if (came.value_or(0) < frames) {
    reply.status = Exit::no;
    reply.error = fmt::format("{} of {} passed within {} s of world time", came.value_or(0), counted(frames, "frame"),
                              operate::seconds(rt::Time(longest_step)));
  }
}

void WorldTime::between() {
  if (!frames_) return;
  const unsigned wanted = *std::exchange(frames_, std::nullopt);
  const auto before = run_->record().seen();
  const auto came = [&] { return static_cast<unsigned>(run_->record().seen() - before); };
  const rt::Time limit = run_->now() + longest_step;
  run_->loop()->step_until([&] { return came() >= wanted; }, limit);
  stepped_.push(came());
}

std::string WorldTime::standing() const {
  const bool stands = run_->loop() != nullptr && run_->loop()->paused() && !frames_;
  return stands ? "paused: `berth world run` lets it go on" : "";
}

void WorldTime::let_go() {
  if (run_->loop() == nullptr) return;
  run_->loop()->pause(false);
  run_->loop()->set_speed(1);
}

}  // namespace berth::cli
