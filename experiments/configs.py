"""The config of each experiment that has one, by the experiment's name."""

from .budget import BudgetConfig
from .claim_config import ClaimConfig, TuneConfig
from .corridor import CorridorConfig
from .fusion import FusionConfig
from .matchers import MatchersConfig
from .motion import MotionConfig
from .outdoor import OutdoorConfig
from .printed import PrintedConfig
from .realism import RealismConfig
from .sweep_config import SweepConfig

CONFIGS: dict[str, type] = {
    "budget": BudgetConfig,
    "claim": ClaimConfig,
    "claim-tune": TuneConfig,
    "corridor": CorridorConfig,
    "fusion": FusionConfig,
    "matchers": MatchersConfig,
    "motion": MotionConfig,
    "outdoor": OutdoorConfig,
    "printed": PrintedConfig,
    "realism": RealismConfig,
    "sweep": SweepConfig,
}
