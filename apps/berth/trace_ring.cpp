#include "trace_ring.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "berth/command/control.hpp"
#include "berth/trace/candump.hpp"
#include "ports.hpp"
#include "studio_host.hpp"
#include "trace_known.hpp"

namespace berth::cli {
namespace {

class RingSource final : public TraceSource {
 public:
  RingSource(std::string path, std::string filter)
      : path_(std::move(path)), filter_(std::move(filter)), reader_("the ring") {}

  tl::expected<State, Failure> turn(trace::Sink& sink) override {
    constexpr int patience_ms = 30'000;
    const command::Request request{ring_verb, {{"from", std::to_string(at_)}, {"filter", filter_}}};
    const auto reply = command::control_call(path_, request, patience_ms);
    if (!reply) return tl::unexpected(failure(Exit::failed, reply.error()));
    if (reply->status != Exit::done) return tl::unexpected(failure(static_cast<Exit>(reply->status), reply->error));
    const auto part = nlohmann::json::parse(reply->json, nullptr, false);
    if (!part.is_object() || !part.contains("text") || !part.contains("next") || !part.contains("end"))
      return tl::unexpected(failure(Exit::failed, path_ + ": the answer has no frames"));
    reader_.feed(part.at("text").get<std::string>(), sink);
    const auto next = part.at("next").get<std::uint64_t>();
    if (!end_) end_ = part.at("end").get<std::uint64_t>();
    const bool over = next >= *end_ || next <= at_;
    at_ = next;
    return over ? State::over : State::more;
  }
  void finish(trace::Sink& sink) override { reader_.finish(sink); }
  const std::vector<std::string>& buses() const noexcept override { return reader_.buses(); }
  std::string format() const override { return "candump"; }

 private:
  std::string path_;
  std::string filter_;
  trace::CandumpReader reader_;
  std::uint64_t at_ = 0;
  std::optional<std::uint64_t> end_;  // after the last wanted entry
};

}  // namespace

tl::expected<std::unique_ptr<TraceSource>, Failure> open_ring(const Options& options, const TraceOptions& trace,
                                                              const KnownNodes& known) {
  if (!trace.file.empty() || !trace.port.empty() || trace.follow)
    return tl::unexpected(
        failure(Exit::usage, "--ring is of a machine that runs: not with a file, --port or --follow"));
  std::string path = options.control;
  if (path.empty() && known.machine()) path = running_control(options, *known.machine());
  if (path.empty()) {
    const std::string machine = known.machine() ? options.machine : "MACHINE";
    return tl::unexpected(failure(
        Exit::failed, fmt::format("{0} does not run: start it in another terminal, `berth up {0} --studio`", machine)));
  }
  if (auto other = runs_another(options, path)) return tl::unexpected(std::move(*other));
  return std::make_unique<RingSource>(std::move(path), trace.from.filter);
}

}  // namespace berth::cli
