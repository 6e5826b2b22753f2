/// The verbs: one function each, which adds it to the command line. Each is in the file that implements the verb;
/// main.cpp has them in the order of the help.
#pragma once

#include <vector>

#include "options.hpp"
#include "verb.hpp"

namespace berth::cli {

void add_demo(Verb& berth, Options& options);
void add_init(Verb& berth, Options& options);
void add_up(Verb& berth, Options& options);
void add_studio(Verb& berth, Options& options);
void add_scan(Verb& berth, Options& options);
void add_status(Verb& berth, Options& options);
void add_watch(Verb& berth, Options& options);
void add_bind(Verb& berth, Options& options);
void add_locate(Verb& berth, Options& options);
void add_replace(Verb& berth, Options& options);
void add_poll(Verb& berth, Options& options);
void add_forget(Verb& berth, Options& options);
void add_boot(Verb& berth, Options& options);
void add_configure(Verb& berth, Options& options);
void add_backup(Verb& berth, Options& options);
void add_upload(Verb& berth, Options& options);
void add_program(Verb& berth, Options& options);
void add_program_image(const Verb& program, Options& options);
void add_sdo(Verb& berth, Options& options);
void add_note(Verb& berth, Options& options);
void add_emcy(Verb& berth, Options& options);
void add_store(Verb& berth, Options& options);
void add_restore(Verb& berth, Options& options);
void add_send(Verb& berth, Options& options);
void add_history(Verb& berth, Options& options);
void add_ports(Verb& berth, Options& options);
void add_nmt(Verb& berth, Options& options);
void add_lss(Verb& berth, Options& options);
void add_eds(Verb& berth, Options& options);
void add_doctor(Verb& berth, Options& options);
void add_trace(Verb& berth, Options& options);
void add_reproduce(Verb& berth, Options& options);
void add_analyze(Verb& berth, Options& options);
void add_link(Verb& berth, Options& options);
void add_compare(Verb& berth, Options& options);
void add_study(Verb& berth, Options& options);
void add_serve(Verb& berth, Options& options);
void add_gateway(Verb& berth, Options& options);
void add_adopt(Verb& berth, Options& options);
void add_document(Verb& berth, Options& options);
void add_export(Verb& berth, Options& options);
void add_import(Verb& berth, Options& options);
void add_device(Verb& berth, Options& options);
void add_sim(Verb& berth, Options& options);
/// The verbs of `berth sim` that another process carries out.
void add_running_plant(const Verb& sim, Options& options);
void add_world(Verb& berth, Options& options);
void add_plant(Verb& berth, Options& options);
void add_fleet(Verb& berth, Options& options);
void add_completion(Verb& berth, Options& options);
void add_man(Verb& berth, Options& options);
void add_version(Verb& berth, Options& options);

/// All of them, in the order of the help.
[[nodiscard]] const std::vector<AddVerb>& all_verbs();

}  // namespace berth::cli
