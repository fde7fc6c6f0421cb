"""From a ChainSpec to a BaseModel: equations of motion, rows for a sensor set, base parameters."""
