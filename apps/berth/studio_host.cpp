#include "studio_host.hpp"

#include <fmt/format.h>

#include <charconv>
#include <nlohmann/json.hpp>
#include <utility>

#include "berth/command/reply.hpp"
#include "berth/document/signals_json.hpp"
#include "berth/io/stream.hpp"
#include "berth/traffic/link_network.hpp"
#include "options.hpp"

#if BERTH_STUDIO
#include "berth/studio/messages.hpp"
#include "berth/studio/pages.hpp"
#include "berth/studio/studio.hpp"
#endif

namespace berth::cli {

#if BERTH_STUDIO

std::optional<Failure> studio_refused(const Options& options) {
  const StudioOptions& offer = options.offers.studio;
  if (!offer.offered() && offer.has_doors())
    return failure(
        Exit::usage,
        "--studio-role, --studio-tokens, --studio-certificate, --studio-key and --studio-open-metrics are for "
        "--studio: write that, too");
  if (offer.certificate.empty() != offer.key.empty())
    return failure(Exit::usage,
                   "a certificate and its key belong together: --studio-certificate FILE --studio-key FILE "
                   "(berth studio: --certificate, --key)");
  if (!offer.named() || io::parse_endpoint(offer.where, studio::default_port)) {
    return std::nullopt;
  }
  return failure(
      Exit::usage,
      fmt::format(
          "--studio={}: write --studio, or --studio=HOST:PORT (`berth studio --listen HOST:PORT`) such as 127.0.0.1:{}",
          offer.where, studio::default_port));
}

namespace {

// Wrong links have been reported already.
std::string signals_of(const design::Machine& machine) {
  std::optional<traffic::LinkPlan> links;
  if (!machine.links.empty()) links = traffic::plan_links(machine);
  const bool good = links && !has_errors(links->findings);
  return document::signals_json(machine, good ? &*links : nullptr);
}

}  // namespace

class StudioHost::Impl {
 public:
  Impl(MachineRun& run, std::unique_ptr<studio::Studio> server, const StudioOptions& offer)
      : run_(&run), server_(std::move(server)), roles_(offer.roles), named_(offer.named()) {
    run_->record().on_frame([this](const std::string& bus, const can::Frame& frame, rt::Time at, bool by_master) {
      server_->frame(bus, frame, at, by_master);
    });
    run_->record().on_error([this](const std::string& bus, const can::Frame& report, rt::Time at,
                                   const std::string& about) { server_->error(bus, report, at, about); });
  }
  ~Impl() {
    run_->record().on_frame({});
    run_->record().on_error({});
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  [[nodiscard]] studio::Studio& server() noexcept { return *server_; }
  [[nodiscard]] const std::vector<std::string>& roles() const noexcept { return roles_; }
  [[nodiscard]] bool named() const noexcept { return named_; }

 private:
  MachineRun* run_;
  std::unique_ptr<studio::Studio> server_;
  std::vector<std::string> roles_;
  bool named_;  // the user named the address
};

tl::expected<std::unique_ptr<StudioHost>, Failure> StudioHost::start(MachineRun& run, const Options& options,
                                                                     const std::string& control,
                                                                     const std::string& fleet, Carry carry) {
  studio::Options wanted;
  if (options.offers.studio.named())
    wanted.where = *io::parse_endpoint(options.offers.studio.where, studio::default_port);
  wanted.named = options.offers.studio.named();
  if (!control.empty()) wanted.token_file = control + ".token";
  wanted.tokens_kept = options.offers.studio.tokens;
  wanted.certificate = options.offers.studio.certificate;
  wanted.key = options.offers.studio.key;
  wanted.simulated = run.world() != nullptr;
  wanted.fleet = fleet;
  wanted.version = BERTH_VERSION;
  wanted.open_metrics = options.offers.studio.open_metrics;
  wanted.signals = signals_of(run.machine());
  auto server = studio::Studio::start(*run.loop(), run.session(), std::move(carry), wanted);
  if (!server) return tl::unexpected(failure(Exit::failed, "--studio: " + server.error()));
  return std::unique_ptr<StudioHost>(
      new StudioHost(std::make_unique<Impl>(run, std::move(*server), options.offers.studio)));
}

bool StudioHost::has_pages() noexcept { return !studio::built_pages().empty(); }

std::vector<std::string> StudioHost::lines() const {
  std::vector<std::string> lines;
  const auto port = impl_->server().where().port;
  if (!impl_->named() && port != studio::default_port)
    lines.push_back(
        fmt::format("Port {} is taken, perhaps by another Studio: this one is at {}", studio::default_port, port));
  if (!has_pages())
    lines.emplace_back("The pages are not in this berth: `./run pages` in the folder of its sources builds them");
  lines.push_back("Berth Studio at " + impl_->server().address(command::Role::configure));
  for (const auto& word : impl_->roles()) {
    const auto role = command::parse_role(word);
    if (role) lines.push_back(fmt::format("Berth Studio, role {}, at {}", word, impl_->server().address(*role)));
  }
  return lines;
}
std::string StudioHost::page() const { return impl_->server().page(); }
void StudioHost::event(const operate::Event& event) { impl_->server().event(event); }
void StudioHost::look() { impl_->server().look(); }

command::Reply StudioHost::ring(const command::Request& request) const {
  constexpr std::size_t at_once = 4096;  // a few milliseconds of the executor
  const auto word = [&](const char* key) {
    const auto found = request.arguments.find(key);
    return found == request.arguments.end() ? std::string() : found->second;
  };
  const std::string number = word("from");
  const std::string filter = word("filter");
  std::uint64_t from = 0;
  const char* const end = number.data() + number.size();
  const auto [last, error] = std::from_chars(number.data(), end, from);
  if (!number.empty() && (error != std::errc() || last != end))
    return command::refusal(Exit::usage, "\"from\" is the number of a frame");
  if (filter.size() > studio::longest_filter)
    return command::refusal(Exit::usage, fmt::format("a filter has at most {} bytes", studio::longest_filter));
  const auto part = impl_->server().ring(from, at_once, filter);
  command::Reply reply;
  reply.json = nlohmann::json{{"text", part.text}, {"next", part.next}, {"end", part.end}}.dump(
      -1, ' ', false, nlohmann::json::error_handler_t::replace);
  return reply;
}

#else

std::optional<Failure> studio_refused(const Options& options) {
  if (!options.offers.studio.offered()) return std::nullopt;
  return failure(Exit::usage, "--studio: this berth was built without it (BERTH_STUDIO=OFF)");
}

class StudioHost::Impl {};

tl::expected<std::unique_ptr<StudioHost>, Failure> StudioHost::start(MachineRun&, const Options& options,
                                                                     const std::string&, const std::string&, Carry) {
  return tl::unexpected(*studio_refused(options));
}

bool StudioHost::has_pages() noexcept { return false; }
std::vector<std::string> StudioHost::lines() const { return {}; }
std::string StudioHost::page() const { return {}; }
void StudioHost::event(const operate::Event&) {}
void StudioHost::look() {}
command::Reply StudioHost::ring(const command::Request&) const {
  return command::refusal(Exit::no, "this berth was built without Studio, which keeps the frames");
}

#endif

StudioHost::StudioHost(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
StudioHost::~StudioHost() = default;

}  // namespace berth::cli
