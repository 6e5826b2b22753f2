#include "studio_host.hpp"

#include <fmt/format.h>

#include <utility>

#include "berth/io/stream.hpp"
#include "options.hpp"

#if BERTH_STUDIO
#include "berth/studio/studio.hpp"
#endif

namespace berth::cli {

#if BERTH_STUDIO

std::optional<Failure> studio_refused(const Options& options) {
  const StudioOptions& offer = options.offers.studio;
  if (!offer.offered() && offer.has_doors())
    return failure(Exit::usage,
                   "--studio-role, --studio-tokens, --studio-certificate and --studio-key are for --studio: "
                   "write that, too");
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

class StudioHost::Impl {
 public:
  Impl(Rig& rig, std::unique_ptr<studio::Studio> server, std::vector<std::string> roles)
      : rig_(&rig), server_(std::move(server)), roles_(std::move(roles)) {
    rig_->record().on_frame([this](const std::string& bus, const can::Frame& frame, rt::Time at, bool by_master) {
      server_->frame(bus, frame, at, by_master);
    });
  }
  ~Impl() { rig_->record().on_frame({}); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  [[nodiscard]] studio::Studio& server() noexcept { return *server_; }
  [[nodiscard]] const std::vector<std::string>& roles() const noexcept { return roles_; }

 private:
  Rig* rig_;
  std::unique_ptr<studio::Studio> server_;
  std::vector<std::string> roles_;
};

tl::expected<std::unique_ptr<StudioHost>, Failure> StudioHost::start(Rig& rig, const Options& options,
                                                                     const std::string& control, Carry carry) {
  studio::Options wanted;
  if (options.offers.studio.named())
    wanted.where = *io::parse_endpoint(options.offers.studio.where, studio::default_port);
  wanted.named = options.offers.studio.named();
  if (!control.empty()) wanted.token_file = control + ".token";
  wanted.tokens_kept = options.offers.studio.tokens;
  wanted.certificate = options.offers.studio.certificate;
  wanted.key = options.offers.studio.key;
  wanted.simulated = rig.world() != nullptr;
  auto server = studio::Studio::start(*rig.loop(), rig.session(), std::move(carry), wanted);
  if (!server) return tl::unexpected(failure(Exit::failed, "--studio: " + server.error()));
  return std::unique_ptr<StudioHost>(
      new StudioHost(std::make_unique<Impl>(rig, std::move(*server), options.offers.studio.roles)));
}

std::vector<std::string> StudioHost::lines() const {
  std::vector<std::string> lines{"Berth Studio at " + impl_->server().address(command::Role::configure)};
  for (const auto& word : impl_->roles()) {
    const auto role = command::parse_role(word);
    if (role) lines.push_back(fmt::format("Berth Studio, role {}, at {}", word, impl_->server().address(*role)));
  }
  return lines;
}
void StudioHost::event(const operate::Event& event) { impl_->server().event(event); }
void StudioHost::look() { impl_->server().look(); }

#else

std::optional<Failure> studio_refused(const Options& options) {
  if (!options.offers.studio.offered()) return std::nullopt;
  return failure(Exit::usage, "--studio: this berth was built without it (BERTH_STUDIO=OFF)");
}

class StudioHost::Impl {};

tl::expected<std::unique_ptr<StudioHost>, Failure> StudioHost::start(Rig&, const Options& options, const std::string&,
                                                                     Carry) {
  return tl::unexpected(*studio_refused(options));
}

std::vector<std::string> StudioHost::lines() const { return {}; }
void StudioHost::event(const operate::Event&) {}
void StudioHost::look() {}

#endif

StudioHost::StudioHost(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
StudioHost::~StudioHost() = default;

}  // namespace berth::cli
