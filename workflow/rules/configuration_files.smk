# The main configuration, checked before Snakemake reads it: Snakemake takes keys that stand twice, and runs what follows `__use_yte__`.
from snakemake.utils import update_config

from fusetune.design.config_file import validate
from fusetune.design.yaml_reader import read_yaml

DEFAULT_CONFIG_FILE = "config/config.yaml"
CONFIG_SCHEMA = read_yaml(PROJECT / "workflow" / "schemas" / "config.schema.yaml")


def told_in_one_line(function, *arguments, **options):
    try:
        return function(*arguments, **options)
    except UserError as error:
        raise WorkflowError(str(error)) from None


def configuration_files():
    """The default file, and those given with --configfile, whose values go before it."""
    given = [os.path.relpath(file) for file in workflow.overwrite_configfiles]
    replaced = workflow.config_settings.replace_workflow_config or not os.path.exists(DEFAULT_CONFIG_FILE)
    return given if given and replaced else [DEFAULT_CONFIG_FILE, *given]


def asked_settings():
    """What the files and --config ask for; each file is checked by itself, then what they make together."""
    asked = {}
    for file in configuration_files():
        values = read_yaml(file)
        validate(values, CONFIG_SCHEMA, file)
        update_config(asked, values)
    update_config(asked, workflow.config_settings.config)
    validate(asked, CONFIG_SCHEMA, "--config" if workflow.config_settings.config else configuration_files()[-1])
    return asked


ASKED = told_in_one_line(asked_settings)
